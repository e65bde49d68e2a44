"""The thermal chamber: a set point, read back, and the air's temperature.

What a controller's values mean is the business of the adapter of its family; what a chamber does is said here.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from schemas.errors import LinkLost, OperatorNeeded, StationRefused, StationTimeout

if TYPE_CHECKING:
    from stations.devices.values import Values

READ_BACK_K = 1e-3
AUTOMATIC = "automatic"
CELSIUS = "celsius"
RUNNING = {"runs", "paused", "program_runs", "program_holds", "holds", "start_timed"}
PLAUSIBLE_C = (-100.0, 250.0)
OWN_LIMITS = ("set_point_low", "set_point_high")


class ThermalChamber(ABC):
    """A chamber behind a controller that ramps by itself, whatever its lines carry."""

    needs: ClassVar[tuple[str, ...]] = ("temperature", "set_point")
    running: ClassVar[str] = AUTOMATIC  # what the controller calls the mode in which it keeps its set point
    standing: ClassVar[str] = "off"

    def __init__(self, values: Values, low: float, high: float) -> None:
        self._values = values
        self.name = values.name
        self._low, self._high = low, high

    @abstractmethod
    def mode(self) -> str:
        """The mode that the controller is in."""

    @abstractmethod
    def require_ready(self) -> None:
        """Refuses a controller that would not do what it is told: an alarm, a program, another unit."""

    def order(self, temperature: float) -> None:
        """Writes the set point; giving the same one twice changes nothing."""
        self._values.write("set_point", temperature)

    def check(self, temperature: float) -> None:
        """Refuses a temperature outside the station's limits; nothing has been set then."""
        if not self._low <= temperature <= self._high:
            raise StationRefused(
                f"{self.name}: set point {temperature:g} °C, {self._low:g} to {self._high:g} °C is allowed; "
                "change the recipe"
            )

    def set_temperature(self, temperature: float) -> None:
        """Sets the target in °C and makes sure that the controller has taken it; where an answer was lost, that decides."""
        self.check(temperature)
        self.require_ready()
        self._require_inside(temperature)
        try:
            self.order(temperature)
        except (StationTimeout, LinkLost):
            if not self._holds(temperature):
                raise
        found, mode = self._values.number("set_point"), self.mode()
        if not self._near(found, temperature) or mode != self.running:
            raise StationRefused(
                f"{self.name}: set point {found:g} °C in mode {mode}, {temperature:g} °C in {self.running} is needed; "
                "check the controller's panel"
            )

    def off(self) -> None:
        """Switches heating and cooling off."""
        self._switch(self.standing)

    def on(self) -> None:
        """Switches heating and cooling on again, for a station whose safe state is a chamber that is off."""
        self._switch(self.running)

    def set_point(self) -> float:
        """The target that the controller keeps, °C."""
        return self._values.number("set_point")

    def temperature(self) -> float:
        """The air's temperature, °C; what no chamber can have is refused."""
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
                f"{self.name}: profile {profile.name} has nothing to write the mode to, which is needed to make it {mode}; "
                "set safety.chamber to set_point or hold"
            )
        self._values.write("mode", mode)
        found = self.mode()
        if found != mode:
            raise StationRefused(f"{self.name}: in mode {found}, {mode} is needed; check the controller's panel")

    def _require_inside(self, temperature: float) -> None:
        """Refuses what the controller itself is set up to refuse."""
        if not all(self._values.has(name) for name in OWN_LIMITS):
            return
        low, high = (self._values.number(name) for name in OWN_LIMITS)
        if not low <= temperature <= high:
            raise StationRefused(
                f"{self.name}: set point {temperature:g} °C, the controller is set up for {low:g} to {high:g} °C; "
                "change the recipe, or the controller's limits"
            )

    def _holds(self, temperature: float) -> bool:
        return self._near(self._values.number("set_point"), temperature)

    def _near(self, found: float, temperature: float) -> bool:
        return abs(found - temperature) <= READ_BACK_K + self._values.step("set_point") / 2.0

    def refuse(self, found: str, needed: str, remedy: str) -> None:
        """Raises that the controller is not as it must be; nothing has been set."""
        raise StationRefused(f"{self.name}: {found}, {needed} is needed; {remedy}")


def refuse_program(name: str, state: str) -> None:
    """Refuses a controller that runs a program of its own: it is not ended from here."""
    if state in RUNNING:
        raise OperatorNeeded(
            f"{name}: the controller's own program is in state {state}, none is needed; end it at the panel"
        )
