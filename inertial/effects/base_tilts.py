import numpy as np

from inertial import frames, operators
from inertial.effects.base import Array, Nonlinear, StationEffect
from inertial.state import State


class BaseTilts(StationEffect):
    """Base of the station that leans as it follows the temperature late: up = (δ1T·θ', δ2T·θ', 1)."""

    id = "base_tilts"
    symbol = "δ1T, δ2T"
    equation = "f = R(α, β)ᵀ·(δ1T·θ', δ2T·θ', 1), τ·dθ'/dt = θ − θ'"
    coefficients = ("level_1T", "level_2T")
    source = "mechanism: thermal expansion of the legs of a table"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("misalignment_temperature", "level_error")
    breaker = "a level on the base while the chamber is heated"
    simplicity = 41
    memory = True
    nonlinear = (Nonlinear("tau", "s", 30.0, 20000.0, "log", 4),)

    def force_change(self, state: State, *, tau: float, **nonlinear: float) -> Array:
        state.need("theta", self.id)
        late = state.temperature_operator((self.id, tau), lambda time, warm: operators.first_order_lag(time, warm, tau))
        return self._leans(state, late - state.reference)

    def start_change(self, state: State, *, tau: float, **nonlinear: float) -> Array:
        return self._leans(state, np.exp(-(state.time - state.time[..., :1]) / tau))

    def _leans(self, state: State, size: Array) -> Array:
        """Change of force (..., n, 3, 2) by leaning about either horizontal by a size (..., n)."""
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        ways = [frames.to_fixture(v, outer, inner) for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        return np.stack([size[..., None] * way for way in ways], axis=-1)
