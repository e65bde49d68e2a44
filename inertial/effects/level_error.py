import numpy as np

from inertial import frames
from inertial.effects.base import Array, StationEffect
from inertial.state import State


class LevelError(StationEffect):
    """Outer axis or laboratory vertical out of level: up = (δ1, δ2, 1)."""

    id = "level_error"
    symbol = "δ1, δ2"
    equation = "f = R(α, β)ᵀ·(δ1, δ2, 1)"
    coefficients = ("level_1", "level_2")
    source = "geometry of a two-axis table, or of a plate and the heading of each placement"
    typical_ug = (5.0, 5000.0)
    hides_behind = ("outer_encoder_offset", "magnetic")
    breaker = (
        "a level on the table; the tilt along the outer axis is identical with the offset of its encoder; of units put down by "
        "hand the same face at several headings"
    )
    simplicity = 40

    def force_change(self, state: State, **nonlinear: float) -> Array:
        if state.outer is None and state.heading is not None:
            return np.stack(frames.horizontal(state.force, state.heading), axis=-1)
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        return np.stack([frames.to_fixture(v, outer, inner) for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))], axis=-1)
