import numpy as np

from inertial.effects.base import Array, StationEffect
from inertial.state import State


class AxisNonorthogonality(StationEffect):
    """Inner axis not square to the outer: a small rotation about y between the two."""

    id = "axis_nonorthogonality"
    symbol = "η"
    equation = "f = (Rx(α)·Ry(η)·Rz(β))ᵀ·up"
    coefficients = ("axis_square",)
    source = "geometry of a two-axis table"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("level_error",)
    breaker = "twelve poses or more"
    simplicity = 41

    def force_change(self, state: State, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        tipped = -np.cos(outer)
        return np.stack([tipped * np.cos(inner), -tipped * np.sin(inner), np.zeros_like(tipped)], axis=-1)[..., None]
