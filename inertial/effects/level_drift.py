"""Floor or base of the station that gives way: up = (δ1t·s, δ2t·s, 1), s = τ·(1 − exp(−t/τ))."""

from typing import ClassVar

import numpy as np

from inertial import frames
from inertial.effects.base import Array, Nonlinear, StationEffect
from inertial.operators import approach
from inertial.state import State


class LevelDrift(StationEffect):
    """Floor or base of the station that gives way: up = (δ1t·s, δ2t·s, 1), s = τ·(1 − exp(−t/τ))."""

    id: ClassVar[str] = "level_drift"
    symbol: ClassVar[str] = "δ1t, δ2t"
    equation: ClassVar[str] = "f = R(α, β)ᵀ·(δ1t·s, δ2t·s, 1), s = τ·(1 − exp(−t/τ))"
    source: ClassVar[str] = "mechanism: a foundation or feet that creep under load"
    typical_ug: ClassVar[tuple[float, float]] = (5.0, 2000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("base_tilts", "level_error", "misalignment_temperature")
    breaker: ClassVar[str] = "a level on the base at the beginning and at the end"
    simplicity: ClassVar[int] = 44
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("settling_h", "h", 0.3, 30.0, "log", 5),)

    def force_change(self, state: State, *, settling_h: float, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        ways = [frames.to_fixture(v, outer, inner) for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        return np.stack(ways, axis=-1) * approach(state.time / 3600.0, settling_h)[..., None, None]

    def names(self) -> tuple[str, ...]:
        return "level_1t", "level_2t"
