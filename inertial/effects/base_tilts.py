from typing import ClassVar

import numpy as np

from inertial import frames
from inertial.effects.base import Array, StationEffect
from inertial.state import State


class BaseTilts(StationEffect):
    """Base of the station that leans as it follows the temperature: up = (δ1T·θ, δ2T·θ, 1)."""

    id: ClassVar[str] = "base_tilts"
    symbol: ClassVar[str] = "δ1T, δ2T"
    equation: ClassVar[str] = "f = R(α, β)ᵀ·(δ1T·θ, δ2T·θ, 1)"
    coefficients: ClassVar[tuple[str, ...]] = ("level_1T", "level_2T")
    source: ClassVar[str] = "mechanism: thermal expansion of the legs of a table"
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 2000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("misalignment_temperature", "level_error")
    breaker: ClassVar[str] = "a level on the base while the chamber is heated"
    simplicity: ClassVar[int] = 41

    def force_change(self, state: State, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        ways = [frames.to_fixture(v, outer, inner) for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        return np.stack([theta[..., None] * way for way in ways], axis=-1)
