from inertial import frames
from inertial.effects.base import Array, StationEffect
from inertial.state import State


class OuterEncoderOffset(StationEffect):
    """Zero of the outer encoder."""

    id = "outer_encoder_offset"
    symbol = "ε"
    equation = "α + ε"
    coefficients = ("outer_offset",)
    source = "geometry of a two-axis table"
    typical_ug = (5.0, 5000.0)
    hides_behind = ("level_error",)
    breaker = "a level on the table: nothing at the angles parts it from level"
    simplicity = 39

    def force_change(self, state: State, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        return frames.to_fixture((0.0, 1.0, 0.0), outer, inner)[..., None]
