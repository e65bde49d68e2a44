from collections.abc import Callable

import numpy as np

from inertial import frames, operators
from inertial.effects.base import Array, StationEffect
from inertial.state import State

_PLAY_RAD = 1e-4
"""Moves larger than this take up the whole play."""


class Backlash(StationEffect):
    """Lost motion of the drives: the table stops short on the side it comes from."""

    id = "backlash"
    symbol = "ε"
    equation = "α + ε·sgn(Δα), β + ε·sgn(Δβ)"
    coefficients = ("backlash_outer", "backlash_inner")
    source = "geometry of a two-axis table"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("pose_hysteresis",)
    breaker = "every pose approached from both sides"
    simplicity = 43

    def force_change(self, state: State, **nonlinear: float) -> Array:
        return self._turned(state, operators.play)  # the drive rests on a side of the play while the axis does not move

    def start_change(self, state: State, **nonlinear: float) -> Array:
        return self._turned(state, operators.play_memory)

    def _turned(self, state: State, operator: Callable[[Array, float], Array]) -> Array:
        """Change of force (..., n, 3, 2) by each axis where its angle is off by an operator of it."""
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        force = frames.force_from_angles(outer, inner)
        about_outer = frames.to_fixture((0.0, 1.0, 0.0), outer, inner)
        about_inner = np.stack([force[..., 1], -force[..., 0], np.zeros_like(inner)], axis=-1)
        sides = [operator(angle, _PLAY_RAD)[..., None] for angle in (outer, inner)]
        return np.stack([sides[0] * about_outer, sides[1] * about_inner], axis=-1)
