from typing import ClassVar

from inertial.effects.base import Array, StationEffect
from inertial.state import State


class GravityValue(StationEffect):
    """Local gravity other than the recipe says."""

    id: ClassVar[str] = "gravity_value"
    symbol: ClassVar[str] = "ε"
    equation: ClassVar[str] = "f·(1 + ε)"
    coefficients: ClassVar[tuple[str, ...]] = ("gravity",)
    source: ClassVar[str] = "pole to equator 5300 ppm; identical with the scale factor"
    typical_ug: ClassVar[tuple[float, float]] = (1.0, 5300.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("scale",)
    breaker: ClassVar[str] = "a surveyed value of gravity"
    simplicity: ClassVar[int] = 37

    def force_change(self, state: State, **nonlinear: float) -> Array:
        return state.force[..., None]
