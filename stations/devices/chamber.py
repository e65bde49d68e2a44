"""The thermal chamber: a set point, read back, and the air's temperature."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from schemas.errors import StationRefused

if TYPE_CHECKING:
    from stations.devices.registers import Registers

READ_BACK_K = 1e-3
AUTOMATIC = "automatic"  # what a controller that has no register for its mode is taken to be in
PLAUSIBLE_C = (-100.0, 250.0)


class ThermalChamber:
    """A chamber behind a controller that ramps by itself."""

    def __init__(self, registers: Registers, low: float, high: float) -> None:
        self._registers = registers
        self._low, self._high = low, high

    def check(self, temperature: float) -> None:
        """Refuses a temperature outside the station's limits; nothing has been set then."""
        if not self._low <= temperature <= self._high:
            message = (
                f"{self._registers.name}: set point {temperature:g} °C, {self._low:g} to {self._high:g} °C is allowed; "
                "change the recipe"
            )
            raise StationRefused(message)

    def set_temperature(self, temperature: float) -> None:
        """Sets the target in °C and makes sure that the controller has taken it."""
        self.check(temperature)
        self._registers.write("set_point", temperature)
        profile = self._registers.profile
        found = self._registers.number("set_point")
        mode = self._registers.text("actual_mode") if profile.has("actual_mode") else AUTOMATIC
        step = profile.register("set_point").scale if profile.register("set_point").type != "float32" else 0.0
        if abs(found - temperature) > READ_BACK_K + step / 2.0 or mode != AUTOMATIC:
            message = (
                f"{self._registers.name}: set point {found:g} °C in mode {mode}, {temperature:g} °C in automatic is "
                "needed; check the controller's panel"
            )
            raise StationRefused(message)

    def off(self) -> None:
        """Switches heating and cooling off."""
        self._switch("off")

    def on(self) -> None:
        """Switches heating and cooling on again, for a station whose safe state is a chamber that is off."""
        self._switch(AUTOMATIC)

    def _switch(self, mode: str) -> None:
        registers = self._registers
        if not registers.profile.has("mode"):
            message = (
                f"{registers.name}: profile {registers.profile.name} has no register for the mode, one is needed to make it "
                f"{mode}; set safety.chamber to set_point or hold"
            )
            raise StationRefused(message)
        registers.write("mode", mode)
        found = registers.text("actual_mode") if registers.profile.has("actual_mode") else registers.text("mode")
        if found != mode:
            message = f"{registers.name}: in mode {found}, {mode} is needed; check the controller's panel"
            raise StationRefused(message)

    def temperature(self) -> float:
        """The air's temperature, °C; what no chamber can have is refused."""
        value = self._registers.number("temperature")
        if not (math.isfinite(value) and PLAUSIBLE_C[0] < value < PLAUSIBLE_C[1]):
            message = (
                f"{self._registers.name}: air at {value:g} °C, {PLAUSIBLE_C[0]:g} to {PLAUSIBLE_C[1]:g} °C is possible; "
                "check sensor and word order"
            )
            raise StationRefused(message)
        return value
