from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class OddQuadratic(CentrifugeEffect):
    """An odd quadratic nonlinearity: a quadratic term whose sign follows the acceleration."""

    id: ClassVar[str] = "odd_quadratic"
    equation: ClassVar[str] = "Koq·a·|a|"
    source: ClassVar[str] = "IEEE Std 1293, Koq"
    unit: ClassVar[str] = "g/g²"
    breaker: ClassVar[str] = "the radius measured at speed (optically), or the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray(a * np.abs(a), dtype=np.float64)
