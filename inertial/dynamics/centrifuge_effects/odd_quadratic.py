import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class OddQuadratic(CentrifugeEffect):
    """An odd quadratic nonlinearity: a quadratic term whose sign follows the acceleration."""

    equation = "Koq·a·|a|"
    source = "IEEE Std 1293, Koq"
    unit = "g/g²"
    breaker = "the radius measured at speed (optically), or the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        return points.acceleration * np.abs(points.acceleration)
