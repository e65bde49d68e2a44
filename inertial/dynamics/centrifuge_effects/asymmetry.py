from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class Asymmetry(CentrifugeEffect):
    """A scale that differs between positive and negative acceleration."""

    id: ClassVar[str] = "asymmetry"
    equation: ClassVar[str] = "K1'·|a|"
    source: ClassVar[str] = "IEEE Std 1293, K1'"
    unit: ClassVar[str] = "g/g"
    breaker: ClassVar[str] = "the same accelerations at another radius"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray(np.abs(a), dtype=np.float64)
