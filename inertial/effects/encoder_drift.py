import numpy as np

from inertial import frames
from inertial.effects.base import Array, Nonlinear, StationEffect
from inertial.operators import approach
from inertial.state import State


class EncoderDrift(StationEffect):
    """Zeros of both encoders that creep during a run: ε·s, s = τ·(1 − exp(−t/τ))."""

    id = "encoder_drift"
    symbol = "εαt, εβt"
    equation = "α + εαt·s, β + εβt·s, s = τ·(1 − exp(−t/τ))"
    coefficients = ("outer_zero_t", "inner_zero_t")
    source = "mechanism: a coupling or a clamp that creeps"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("outer_encoder_offset", "slot_rotation", "misalignment_temperature")
    breaker = "the first pose once more at the end, under an autocollimator"
    simplicity = 46
    nonlinear = (Nonlinear("settling_h", "h", 0.3, 30.0, "log", 5),)

    def force_change(self, state: State, *, settling_h: float, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        force = frames.force_from_angles(outer, inner)
        by_outer = frames.to_fixture((0.0, 1.0, 0.0), outer, inner)
        by_inner = np.stack([force[..., 1], -force[..., 0], np.zeros_like(inner)], axis=-1)
        return np.stack([by_outer, by_inner], axis=-1) * approach(state.time / 3600.0, settling_h)[..., None, None]
