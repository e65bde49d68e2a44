"""Legs of a climate unit between the records of a procedure: temperature, humidity and pressure of the air around the units."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipelines.procedures.recorded import ProcedureStep, at_rest

ROLE = "climate"
LEG = "leg"
MINUTE_S = 60.0


@dataclass(frozen=True)
class Leg:
    """A leg with its levels: °C, % (None: that of the room), hPa, and seconds for the change and the hold."""

    temperature_C: float
    humidity_pct: float | None
    pressure_hPa: float
    change_s: float
    hold_s: float


def leg_step(name: str, leg: Leg, soak: int) -> ProcedureStep:
    """The record of a leg, which counts as a separate soak: the chamber follows the unit, and nothing settles before it."""
    setting = {
        "humidity_pct": leg.humidity_pct or 0.0, "pressure_hPa": leg.pressure_hPa,
        "change_s": leg.change_s, "hold_s": leg.hold_s,
    }  # fmt: skip
    return ProcedureStep(
        f"{LEG} {name}", at_rest(ROLE), leg.temperature_C, lasting_s=leg.change_s + leg.hold_s,
        soak=soak, settled=False, role=ROLE, setting=setting,
    )  # fmt: skip


def expose(equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
    """The recording of a leg that the climate unit carries out."""
    setting = step.setting
    humidity = setting["humidity_pct"] or None
    return equipment.expose(
        step.temperature_C, humidity, setting["pressure_hPa"], setting["change_s"], setting["hold_s"], slots
    )
