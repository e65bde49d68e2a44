"""Bias that differs for positive and negative specific force."""

from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class BiasAsymmetry(SensorEffect):
    """Bias that differs for positive and negative specific force."""

    id: ClassVar[str] = "bias_asymmetry"
    symbol: ClassVar[str] = "K0′"
    equation: ClassVar[str] = "½K0′·sgn(fi)"
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("odd_quadratic", "third_order", "dead_zone")
    breaker: ClassVar[str] = "poses near 0 g on this axis, from both sides"
    simplicity: ClassVar[int] = 14
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        del nonlinear
        f = state.along(axis)
        return stack(state, [np.where(np.abs(f) < 1e-9, 0.0, np.sign(f))])

    def names(self, axis: int) -> tuple[str, ...]:
        del axis
        return ("K0'",)
