import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleAsymmetry(SensorEffect):
    """Scale factor that differs for positive and negative specific force."""

    id = "scale_asymmetry"
    symbol = "K1′"
    equation = "½K1′·|fi|"
    coefficients = ("K1'",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (1.0, 500.0)
    hides_behind = ("second_order", "fourth_order")
    breaker = "poses with |fi| between 0.2 and 0.8 g"
    simplicity = 12
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [np.abs(state.along(axis))])
