from typing import ClassVar

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleAsymmetry(SensorEffect):
    """Scale factor that differs for positive and negative specific force."""

    id: ClassVar[str] = "scale_asymmetry"
    symbol: ClassVar[str] = "K1′"
    equation: ClassVar[str] = "½K1′·|fi|"
    coefficients: ClassVar[tuple[str, ...]] = ("K1'",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("second_order", "fourth_order")
    breaker: ClassVar[str] = "poses with |fi| between 0.2 and 0.8 g"
    simplicity: ClassVar[int] = 12
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.along(axis)
        return stack(state, [np.abs(f)])
