import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class Bias(SensorEffect):
    """Zero-g output of the sensor."""

    id = "bias"
    symbol = "K0"
    equation = "K0"
    coefficients = ("K0",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (50.0, 150000.0)
    hides_behind = ("level_error",)
    breaker = "opposed faces, each axis up and down"
    same_on_axes = True
    simplicity = 0

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [np.ones_like(state.time)])
