import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class BiasAsymmetry(SensorEffect):
    """Bias that differs for positive and negative specific force, with a transition of finite width."""

    id = "bias_asymmetry"
    symbol = "K0′"
    equation = "½K0′·sgn(fi), smoothed over w"
    coefficients = ("K0'",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (1.0, 500.0)
    hides_behind = ("odd_quadratic", "third_order", "dead_zone")
    breaker = "poses near 0 g on this axis, from both sides"
    simplicity = 14
    sharp = True
    nonlinear = (Nonlinear("transition", "g", 1e-5, 0.05, "log", 5),)

    def columns(self, state: State, axis: int, *, transition: float, **nonlinear: float) -> Array:
        return stack(state, [np.tanh(state.along(axis) / transition)])
