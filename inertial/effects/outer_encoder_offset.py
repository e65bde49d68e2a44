from typing import ClassVar

from inertial import frames
from inertial.effects.base import Array, StationEffect
from inertial.state import State


class OuterEncoderOffset(StationEffect):
    """Zero of the outer encoder."""

    id: ClassVar[str] = "outer_encoder_offset"
    symbol: ClassVar[str] = "ε"
    equation: ClassVar[str] = "α + ε"
    coefficients: ClassVar[tuple[str, ...]] = ("outer_offset",)
    source: ClassVar[str] = "geometry of a two-axis table"
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 5000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("level_error",)
    breaker: ClassVar[str] = "a level on the table: nothing at the angles parts it from level"
    simplicity: ClassVar[int] = 39

    def force_change(self, state: State, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        turned = frames.to_fixture((0.0, 1.0, 0.0), outer, inner)
        return turned[..., None]
