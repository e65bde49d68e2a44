import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class MassOffset(CentrifugeEffect):
    """An offset of the proof mass from the turning centre of the mounting: the radius changes when the unit is reversed."""

    equation = "(δ/r)·|a|"
    source = "mechanism: r₊ = r + δ, r₋ = r − δ"
    unit = "g/g"
    breaker = "the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        return np.abs(points.acceleration) * points.radius_m[0] / points.radius_m
