from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class FifthOrder(SensorEffect):
    """Fifth power of the specific force."""

    id: ClassVar[str] = "fifth_order"
    symbol: ClassVar[str] = "K5"
    equation: ClassVar[str] = "K5·fi⁵"
    coefficients: ClassVar[tuple[str, ...]] = ("K5",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("third_order", "odd_quadratic")
    breaker: ClassVar[str] = "poses with |fi| near 0.5 and 0.75 g, or a centrifuge"
    simplicity: ClassVar[int] = 17
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.along(axis)
        return stack(state, [f**5])
