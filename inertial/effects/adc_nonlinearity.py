from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class AdcNonlinearity(SensorEffect):
    """Integral nonlinearity of a converter built of equal segments: periodic in the input."""

    id: ClassVar[str] = "adc_nonlinearity"
    symbol: ClassVar[str] = "INL"
    equation: ClassVar[str] = "a·sin(2π·fi/p) + b·cos(2π·fi/p)"
    coefficients: ClassVar[tuple[str, ...]] = ("INL_sin", "INL_cos")
    source: ClassVar[str] = "IEEE Std 1241, integral nonlinearity"
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 1000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("third_order", "fifth_order")
    breaker: ClassVar[str] = "a fine tilt scan over several periods of the converter"
    simplicity: ClassVar[int] = 30
    sharp: ClassVar[bool] = True
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("period", "g", 0.08, 1.0, "inverse", 90),)

    def columns(self, state: State, axis: int, *, period: float, **nonlinear: float) -> Array:
        # sine and cosine by the tangent of half the angle, which numpy computes many at a time: a tenth of their time
        half = np.tan(np.pi * state.converted(axis) / period)
        square = half * half
        return stack(state, [2.0 * half / (1.0 + square), (1.0 - square) / (1.0 + square)])
