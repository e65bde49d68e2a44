from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class ThirdOrder(CentrifugeEffect):
    """A cubic nonlinearity of the sensing element."""

    id: ClassVar[str] = "third_order"
    equation: ClassVar[str] = "K3·a³"
    source: ClassVar[str] = "IEEE Std 1293, K3"
    unit: ClassVar[str] = "g/g³"
    breaker: ClassVar[str] = "points at higher accelerations, in both mountings"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray(a**3, dtype=np.float64)
