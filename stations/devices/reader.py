"""The reader of the devices under test: the clock of their samples and the instruments of the fixture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from schemas.errors import OperatorNeeded, StationRefused

if TYPE_CHECKING:
    from collections.abc import Mapping

    from stations.devices.registers import Registers
    from stations.devices.slot import Slot

RATE_HZ = 1e-3  # how well a rate is read back


@dataclass(frozen=True)
class Instruments:
    """The fixture's instruments at one instant: by slot °C and V, for all g rms."""

    temperature_C: list[float]
    supply_V: list[float]
    vibration_g: float


class Reader:
    """A reader with its slots by number."""

    def __init__(self, registers: Registers, slots: Mapping[int, Slot], fastest_hz: float) -> None:
        self._registers = registers
        self.slots = dict(slots)
        self._fastest = fastest_hz

    def check(self, rate_hz: float) -> None:
        """Refuses a rate outside the station's limits."""
        if not 0.0 < rate_hz <= self._fastest:
            message = (
                f"{self._registers.name}: {rate_hz:g} Hz, up to {self._fastest:g} Hz is allowed; change the recipe"
            )
            raise StationRefused(message)

    def start(self, rate_hz: float) -> None:
        """Starts sampling in all slots at once; the first sample comes one period later."""
        self.check(rate_hz)
        registers = self._registers
        if registers.text("sampling") != "stopped":
            registers.write("sampling", "stopped")
        if abs(registers.number("rate") - rate_hz) > RATE_HZ:
            registers.write("rate", rate_hz)
            found = registers.number("rate")
            if abs(found - rate_hz) > RATE_HZ:
                message = (
                    f"{registers.name}: samples at {found:g} Hz, {rate_hz:g} Hz is needed; choose a rate it can keep"
                )
                raise StationRefused(message)
        registers.write("sampling", "running")

    def stop(self) -> None:
        """Stops sampling; the samples stay in the slots' memories."""
        self._registers.write("sampling", "stopped")

    def instruments(self) -> Instruments:
        """Temperatures, supplies and vibration now; impossible ones are refused."""
        values = self._registers.read_group("instruments")
        temperature, supply = values["temperature"], values["supply"]
        vibration = self._registers.number("vibration")
        if not isinstance(temperature, list) or not isinstance(supply, list) or not math.isfinite(vibration):
            message = (
                f"{self._registers.name}: instruments do not read as the profile says; check word order and counts"
            )
            raise StationRefused(message)
        return Instruments(temperature, supply, vibration)

    def since_power(self) -> float:
        """Seconds since the devices were powered."""
        return self._registers.number("since_power")

    def require_closed_door(self) -> None:
        """Stops the run while the chamber's door is open."""
        if self._registers.text("door") != "closed":
            message = f"{self._registers.name}: the chamber's door is open, closed is needed; close it and start again"
            raise OperatorNeeded(message)
