from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class SecondOrderTemperature(SensorEffect):
    """Quadratic term that follows temperature."""

    id: ClassVar[str] = "second_order_temperature"
    symbol: ClassVar[str] = "K2T"
    equation: ClassVar[str] = "θ·K2T·fi²"
    coefficients: ClassVar[tuple[str, ...]] = ("K2T",)
    source: ClassVar[str] = "mechanism: stiffness of the suspension over temperature"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 500.0)
    hides_behind: ClassVar[tuple[str, ...]] = ()
    breaker: ClassVar[str] = "nine poses or more at three temperatures or more"
    simplicity: ClassVar[int] = 19
    sharp: ClassVar[bool] = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        f = state.along(axis)
        return stack(state, [theta * f**2])
