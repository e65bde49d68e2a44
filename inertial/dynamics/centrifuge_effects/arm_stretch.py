import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class ArmStretch(CentrifugeEffect):
    """An arm that stretches with the square of the rate: the acceleration is larger than that of the nominal radius."""

    equation = "κ·a·|a|·(r₀/r)"
    source = "mechanism: r = r₀(1 + κω²)"
    unit = "g/g²"
    breaker = "the radius measured at speed (optically), or the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        return points.acceleration * np.abs(points.acceleration) * points.radius_m[0] / points.radius_m
