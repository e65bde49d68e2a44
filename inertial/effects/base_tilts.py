import numpy as np

from inertial import frames
from inertial.effects.base import Array, StationEffect
from inertial.state import State


class BaseTilts(StationEffect):
    """Base of the station that leans as it follows the temperature: up = (δ1T·θ, δ2T·θ, 1)."""

    id = "base_tilts"
    symbol = "δ1T, δ2T"
    equation = "f = R(α, β)ᵀ·(δ1T·θ, δ2T·θ, 1)"
    coefficients = ("level_1T", "level_2T")
    source = "mechanism: thermal expansion of the legs of a table"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("misalignment_temperature", "level_error")
    breaker = "a level on the base while the chamber is heated"
    simplicity = 41

    def force_change(self, state: State, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        ways = [frames.to_fixture(v, outer, inner) for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        return np.stack([theta[..., None] * way for way in ways], axis=-1)
