from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class BiasAsymmetry(SensorEffect):
    """Bias that differs for positive and negative specific force, with a transition of finite width."""

    id: ClassVar[str] = "bias_asymmetry"
    symbol: ClassVar[str] = "K0′"
    equation: ClassVar[str] = "½K0′·sgn(fi), smoothed over w"
    coefficients: ClassVar[tuple[str, ...]] = ("K0'",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("odd_quadratic", "third_order", "dead_zone")
    breaker: ClassVar[str] = "poses near 0 g on this axis, from both sides"
    simplicity: ClassVar[int] = 14
    sharp: ClassVar[bool] = True
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("transition", "g", 1e-5, 0.05, "log", 5),)

    def columns(self, state: State, axis: int, *, transition: float, **nonlinear: float) -> Array:
        return stack(state, [np.tanh(state.along(axis) / transition)])
