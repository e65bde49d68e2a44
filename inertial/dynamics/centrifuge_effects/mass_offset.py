from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class MassOffset(CentrifugeEffect):
    """An offset of the proof mass from the turning centre of the mounting: the radius changes when the unit is reversed."""

    id: ClassVar[str] = "mass_offset"
    equation: ClassVar[str] = "(δ/r)·|a|"
    source: ClassVar[str] = "mechanism: r₊ = r + δ, r₋ = r − δ"
    unit: ClassVar[str] = "g/g"
    breaker: ClassVar[str] = "the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray(np.abs(a) * points.radius_m[0] / points.radius_m, dtype=np.float64)
