import numpy as np

from inertial import frames
from inertial.effects.base import Array, Nonlinear, StationEffect
from inertial.operators import approach
from inertial.state import State


class LevelDrift(StationEffect):
    """Floor or base of the station that gives way: up = (δ1t·s, δ2t·s, 1), s = τ·(1 − exp(−t/τ))."""

    id = "level_drift"
    symbol = "δ1t, δ2t"
    equation = "f = R(α, β)ᵀ·(δ1t·s, δ2t·s, 1), s = τ·(1 − exp(−t/τ))"
    coefficients = ("level_1t", "level_2t")
    source = "mechanism: a foundation or feet that creep under load"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("base_tilts", "level_error", "misalignment_temperature")
    breaker = "a level on the base at the beginning and at the end"
    simplicity = 44
    nonlinear = (Nonlinear("settling_h", "h", 0.3, 30.0, "log", 5),)

    def force_change(self, state: State, *, settling_h: float, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        ways = [frames.to_fixture(v, outer, inner) for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        return np.stack(ways, axis=-1) * approach(state.time / 3600.0, settling_h)[..., None, None]
