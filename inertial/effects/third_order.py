from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ThirdOrder(SensorEffect):
    """Cubic nonlinearity of the transfer curve."""

    id: ClassVar[str] = "third_order"
    symbol: ClassVar[str] = "K3"
    equation: ClassVar[str] = "K3·fi³"
    coefficients: ClassVar[tuple[str, ...]] = ("K3",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 1000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("scale", "odd_quadratic", "fifth_order")
    breaker: ClassVar[str] = "poses with |fi| near 0.24, 0.5 and 0.75 g, or a centrifuge"
    simplicity: ClassVar[int] = 11
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.along(axis)
        return stack(state, [f**3])
