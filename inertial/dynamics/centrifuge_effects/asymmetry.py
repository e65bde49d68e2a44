import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class Asymmetry(CentrifugeEffect):
    """A scale that differs between positive and negative acceleration."""

    equation = "K1'·|a|"
    source = "IEEE Std 1293, K1'"
    unit = "g/g"
    breaker = "the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        return np.abs(points.acceleration)
