from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleAging(SensorEffect):
    """Scale factor that drifts at a constant rate."""

    id: ClassVar[str] = "scale_aging"
    symbol: ClassVar[str] = "K1t"
    equation: ClassVar[str] = "K1t·t·(fi + δj·fj + δk·fk)"
    coefficients: ClassVar[tuple[str, ...]] = ("K1t",)
    source: ClassVar[str] = "mechanism: ageing of the reference or the magnet"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 1000.0)
    per: ClassVar[tuple[str, ...]] = ("g·h",)
    hides_behind: ClassVar[tuple[str, ...]] = ("scale_temperature",)
    breaker: ClassVar[str] = "opposed poses at the beginning and at the end"
    simplicity: ClassVar[int] = 28
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        hours = state.time / 3600.0
        return stack(state, [hours * state.along(axis)])
