from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class Bias(SensorEffect):
    """Zero-g output of the sensor."""

    id: ClassVar[str] = "bias"
    symbol: ClassVar[str] = "K0"
    equation: ClassVar[str] = "K0"
    coefficients: ClassVar[tuple[str, ...]] = ("K0",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (50.0, 150000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("level_error",)
    breaker: ClassVar[str] = "opposed faces, each axis up and down"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 0

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [np.ones_like(state.time)])
