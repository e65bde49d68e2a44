import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class OddQuadratic(SensorEffect):
    """Quadratic term that keeps the sign of the specific force."""

    id = "odd_quadratic"
    symbol = "Koq"
    equation = "Koq·fi·|fi|"
    coefficients = ("Koq",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (1.0, 500.0)
    hides_behind = ("third_order", "fifth_order", "bias_asymmetry")
    breaker = "poses with |fi| near 0.24 g"
    simplicity = 13
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.along(axis)
        return stack(state, [f * np.abs(f)])
