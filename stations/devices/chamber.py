"""The thermal chamber: set point with read-back, and air temperature.

The adapter of a controller family defines the meaning of its values; this module defines the functions of a chamber.
"""

import math
from abc import ABC, abstractmethod
from typing import ClassVar

from schemas.errors import LinkLost, OperatorNeeded, StationRefused, StationTimeout
from stations.devices.commands import Values

READ_BACK_K = 1e-3
AUTOMATIC = "automatic"
CELSIUS = "celsius"
RUNNING = {"runs", "paused", "program_runs", "program_holds", "holds", "start_timed"}
PLAUSIBLE_C = (-100.0, 250.0)
OWN_LIMITS = ("set_point_low", "set_point_high")


class ThermalChamber(ABC):
    """A chamber behind a controller that ramps by itself, with registers or with text commands."""

    needs: ClassVar[tuple[str, ...]] = ("temperature", "set_point")
    running: ClassVar[str] = AUTOMATIC  # the controller's name of the mode in which it controls to its set point
    standing: ClassVar[str] = "off"

    def __init__(self, values: Values, low: float, high: float) -> None:
        self._values = values
        self.name = values.name
        self._low, self._high = low, high

    @abstractmethod
    def mode(self) -> str:
        """The present mode of the controller."""

    @abstractmethod
    def require_ready(self) -> None:
        """Refuses a controller that would not follow a set point: an alarm, a running program, another unit."""

    def order(self, temperature: float) -> None:
        """Writes the set point; a repeated value has no further effect."""
        self._values.write("set_point", temperature)

    def check(self, temperature: float) -> None:
        """Refuses a temperature outside the limits of the station before anything is set."""
        if not self._low <= temperature <= self._high:
            raise StationRefused(
                f"{self.name}: set point {temperature:g} °C, {self._low:g} to {self._high:g} °C is allowed; "
                "change the recipe"
            )

    def set_temperature(self, temperature: float) -> None:
        """Sets the target in °C and reads it back; after a lost answer the value read back decides."""
        self.check(temperature)
        self.require_ready()
        self._require_inside(temperature)
        try:
            self.order(temperature)
        except (StationTimeout, LinkLost):
            if not self._near(self.set_point(), temperature):
                raise
        actual, mode = self.set_point(), self.mode()
        if not self._near(actual, temperature) or mode != self.running:
            raise StationRefused(
                f"{self.name}: set point {actual:g} °C in mode {mode}, {temperature:g} °C in {self.running} is needed; "
                "check the controller's panel"
            )

    def off(self) -> None:
        """Switches heating and cooling off."""
        self._switch(self.standing)

    def on(self) -> None:
        """Switches heating and cooling on again, for a station whose safe state is a chamber that is off."""
        self._switch(self.running)

    def set_point(self) -> float:
        """The set point in the controller, °C."""
        return self._values.number("set_point")

    def temperature(self) -> float:
        """The air temperature, °C; a physically impossible reading is refused."""
        value = self._values.number("temperature")
        if not (math.isfinite(value) and PLAUSIBLE_C[0] < value < PLAUSIBLE_C[1]):
            raise StationRefused(
                f"{self.name}: air at {value:g} °C, {PLAUSIBLE_C[0]:g} to {PLAUSIBLE_C[1]:g} °C is possible; "
                "check sensor and word order"
            )
        return value

    def _switch(self, mode: str) -> None:
        profile = self._values.profile
        if not profile.has("mode") or not profile.entry("mode").writable:
            raise StationRefused(
                f"{self.name}: profile {profile.name} has no writable mode, one is needed to switch to {mode}; "
                "set safety.chamber to set_point or hold"
            )
        self._values.write("mode", mode)
        actual = self.mode()
        if actual != mode:
            raise StationRefused(f"{self.name}: in mode {actual}, {mode} is needed; check the controller's panel")

    def _require_inside(self, temperature: float) -> None:
        """Refuses a set point outside the limits that are set in the controller."""
        if not all(self._values.has(name) for name in OWN_LIMITS):
            return
        low, high = (self._values.number(name) for name in OWN_LIMITS)
        if not low <= temperature <= high:
            raise StationRefused(
                f"{self.name}: set point {temperature:g} °C, the controller allows {low:g} to {high:g} °C; "
                "change the recipe, or the controller's limits"
            )

    def _near(self, actual: float, temperature: float) -> bool:
        return abs(actual - temperature) <= READ_BACK_K + self._values.step("set_point") / 2.0

    def refuse(self, found: str, needed: str, remedy: str) -> None:
        """Raises the error of a controller in the wrong state; nothing has been set."""
        raise StationRefused(f"{self.name}: {found}, {needed} is needed; {remedy}")


def refuse_program(name: str, state: str) -> None:
    """Refuses a controller that runs its own program; this software does not end it."""
    if state in RUNNING:
        raise OperatorNeeded(
            f"{name}: the controller's own program is in state {state}, none is needed; end it at the panel"
        )
