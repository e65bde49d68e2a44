from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class ArmStretch(CentrifugeEffect):
    """An arm that stretches with the square of the rate: the acceleration is larger than that of the nominal radius."""

    id: ClassVar[str] = "arm_stretch"
    equation: ClassVar[str] = "κ·a·|a|·(r₀/r)"
    source: ClassVar[str] = "mechanism: r = r₀(1 + κω²)"
    unit: ClassVar[str] = "g/g²"
    breaker: ClassVar[str] = "the radius measured at speed (optically), or the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray(a * np.abs(a) * points.radius_m[0] / points.radius_m, dtype=np.float64)
