from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class Scale(SensorEffect):
    """Output per unit of specific force along the sensor's own axis."""

    id: ClassVar[str] = "scale"
    symbol: ClassVar[str] = "K1"
    equation: ClassVar[str] = "K1·fi"
    coefficients: ClassVar[tuple[str, ...]] = ("K1",)
    source: ClassVar[str] = "IEEE Std 1293-1998, model equation"
    typical_ug: ClassVar[tuple[float, float]] = (1000.0, 10000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("gravity_value",)
    breaker: ClassVar[str] = "a surveyed value of local gravity"
    simplicity: ClassVar[int] = 1

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.force[..., axis]
        return stack(state, [f])
