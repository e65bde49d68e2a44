"""Conditions that pause a run, judged from readings of the station; nothing here accesses a device."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from schemas.errors import OperatorNeeded
from schemas.safety import Suspenders
from schemas.station import Soak
from stations.devices.reader import Guarded, Instruments

Condition = Literal[
    "door", "vibration", "supply", "chamber", "device", "table", "samples", "link", "clock", "recording"
]


@dataclass(frozen=True)
class Reason:
    """Why a run pauses: the condition, its description, and the slots concerned; empty means all."""

    condition: Condition
    text: str
    slots: tuple[int, ...] = ()


class Suspended(Exception):
    """A condition holds: the capture pauses and returns to its last checkpoint. Never leaves the capture."""

    def __init__(self, reasons: Sequence[Reason], *, spoilt: bool) -> None:
        self.reasons = tuple(reasons)
        self.spoilt = spoilt
        super().__init__("; ".join(reason.text for reason in reasons))


class EmergencyStop(OperatorNeeded):
    """The emergency stop is pressed: the run ends and does not wait for its release."""


def require_released(instruments: Instruments | Guarded) -> None:
    """Ends the run where the emergency stop is pressed."""
    if instruments.stop_pressed:
        message = "station: the emergency stop is pressed, released is needed; make sure that no person is in danger, release it "
        raise EmergencyStop(message + "and give the command again: the run resumes where it stopped")


@dataclass(frozen=True)
class Watched:
    """The rules of a station's file for one run; ``reference`` is the supply by slot at the start, V.

    ``supply_ratio`` is the supply that a procedure has set over that at the start; bounds in V hold where it is 1. ``most_V`` is
    the absolute maximum of the devices' supply, which holds always.
    """

    rules: Suspenders
    soak: Soak
    reference: dict[int, float]
    supply_ratio: float = 1.0
    most_V: float = math.inf

    def instrument_reasons(self, instruments: Instruments, slots: Sequence[int]) -> list[Reason]:
        """Reasons from the reader: door, vibration and the supply of these slots."""
        reasons: list[Reason] = []
        if self.rules.door and instruments.door_open:
            reasons.append(Reason("door", "the chamber's door is open, closed is needed"))
        if not instruments.vibration_g <= self.rules.vibration_g:
            text = f"vibration {instruments.vibration_g:.3g} g rms, {self.rules.vibration_g:g} is allowed"
            reasons.append(Reason("vibration", text))
        wrong = {slot: text for slot in slots if (text := self._supply(slot, instruments.supply_V[slot]))}
        if wrong:
            first = min(wrong)
            more = f" (and {len(wrong) - 1} more slots)" if len(wrong) > 1 else ""
            reasons.append(Reason("supply", f"slot {first}: {wrong[first]}{more}", tuple(wrong)))
        return reasons

    def thermal_reasons(
        self, target: float, air: float, instruments: Instruments, slots: Sequence[int]
    ) -> list[Reason]:
        """Reasons against a record at ``target`` °C: air or devices have left their band."""
        reasons: list[Reason] = []
        band = max(self.rules.chamber_band_K, self.soak.band_K)
        if abs(air - target) > band:
            text = f"the chamber's air is at {air:.2f} °C, {target:g} ± {band:g} °C is needed"
            reasons.append(Reason("chamber", text))
        celsius, soak_band = instruments.temperature_C, self.soak.band_K
        left = tuple(s for s in slots if math.isfinite(celsius[s]) and abs(celsius[s] - target) > soak_band)
        if left:
            text = f"slot {left[0]}: device at {celsius[left[0]]:.2f} °C, {target:g} ± {soak_band:g} °C is needed"
            reasons.append(Reason("device", text, left))
        return reasons

    def _supply(self, slot: int, volt: float) -> str:
        """Why a slot's supply is out of tolerance; empty where it is not."""
        bounds, start = self.rules.supply_V, self.reference.get(slot)
        if not volt <= self.most_V and math.isfinite(self.most_V):
            return f"supply {volt:.4g} V, at most {self.most_V:g} V is allowed (maximum.voltage of the power supply)"
        start = None if start is None else self.supply_ratio * start
        if bounds is not None and self.supply_ratio == 1.0 and not bounds[0] <= volt <= bounds[1]:
            return f"supply {volt:.4g} V, {bounds[0]:g} to {bounds[1]:g} V is needed"
        if start is not None and not abs(volt - start) <= self.rules.supply_change * abs(start):
            return f"supply {volt:.4g} V, {start:.4g} V ± {self.rules.supply_change:.3g} of it is needed"
        return ""
