from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class FourthOrder(SensorEffect):
    """Fourth power of the specific force."""

    id: ClassVar[str] = "fourth_order"
    symbol: ClassVar[str] = "K4"
    equation: ClassVar[str] = "K4·fi⁴"
    coefficients: ClassVar[tuple[str, ...]] = ("K4",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("second_order", "scale_asymmetry")
    breaker: ClassVar[str] = "poses with |fi| between 0.2 and 0.8 g, or a centrifuge"
    simplicity: ClassVar[int] = 16
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.along(axis)
        return stack(state, [f**4])
