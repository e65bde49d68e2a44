from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class SecondOrder(SensorEffect):
    """Output proportional to the square of the specific force: rectifies vibration."""

    id: ClassVar[str] = "second_order"
    symbol: ClassVar[str] = "K2"
    equation: ClassVar[str] = "K2·fi²"
    coefficients: ClassVar[tuple[str, ...]] = ("K2",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 1000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("scale_asymmetry", "fourth_order", "cross_axis_quadratic")
    breaker: ClassVar[str] = "poses on edges or in general directions (on faces fi² and |fi| are one column)"
    simplicity: ClassVar[int] = 10
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.along(axis)
        return stack(state, [f**2])
