from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class OddQuadratic(SensorEffect):
    """Quadratic term that keeps the sign of the specific force."""

    id: ClassVar[str] = "odd_quadratic"
    symbol: ClassVar[str] = "Koq"
    equation: ClassVar[str] = "Koq·fi·|fi|"
    coefficients: ClassVar[tuple[str, ...]] = ("Koq",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("third_order", "fifth_order", "bias_asymmetry")
    breaker: ClassVar[str] = "poses with |fi| near 0.24 g"
    simplicity: ClassVar[int] = 13
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.along(axis)
        return stack(state, [f * np.abs(f)])
