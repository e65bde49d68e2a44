"""Reference that drifts at a constant rate while all units are measured."""

from typing import ClassVar

from inertial.effects.base import Array, StationEffect
from inertial.state import State


class ReferenceDrift(StationEffect):
    """Reference that drifts at a constant rate while all units are measured."""

    id: ClassVar[str] = "reference_drift"
    symbol: ClassVar[str] = "εt"
    equation: ClassVar[str] = "f·(1 + εt·t)"
    source: ClassVar[str] = "mechanism: warm-up or ageing of the voltage reference of the reader"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 1000.0)
    per: ClassVar[tuple[str, ...]] = ("h",)
    hides_behind: ClassVar[tuple[str, ...]] = ("scale_temperature", "scale_aging")
    breaker: ClassVar[str] = "the first temperature again at the end, and a second reference beside the first"
    simplicity: ClassVar[int] = 29

    def force_change(self, state: State, **nonlinear: float) -> Array:
        return (state.time / 3600.0)[..., None, None] * state.force[..., None]

    def names(self) -> tuple[str, ...]:
        return ("epsilon_t",)
