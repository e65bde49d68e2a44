import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class AdcNonlinearity(SensorEffect):
    """Integral nonlinearity of a converter built of equal segments: periodic in the input."""

    id = "adc_nonlinearity"
    symbol = "INL"
    equation = "a·sin(2π·fi/p) + b·cos(2π·fi/p)"
    coefficients = ("INL_sin", "INL_cos")
    source = "IEEE Std 1241, integral nonlinearity"
    typical_ug = (5.0, 1000.0)
    hides_behind = ("third_order", "fifth_order")
    breaker = "a fine tilt scan over several periods of the converter"
    simplicity = 30
    sharp = True
    nonlinear = (Nonlinear("period", "g", 0.08, 1.0, "inverse", 90),)

    def columns(self, state: State, axis: int, *, period: float, **nonlinear: float) -> Array:
        # sine and cosine by the tangent of half the angle, which numpy computes many at a time: a tenth of their time
        half = np.tan(np.pi * state.converted(axis) / period)
        square = half * half
        return stack(state, [2.0 * half / (1.0 + square), (1.0 - square) / (1.0 + square)])
