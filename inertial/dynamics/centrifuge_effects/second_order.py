from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class SecondOrder(CentrifugeEffect):
    """A quadratic nonlinearity of the sensing element."""

    id: ClassVar[str] = "second_order"
    equation: ClassVar[str] = "K2·a²"
    source: ClassVar[str] = "IEEE Std 1293, K2"
    unit: ClassVar[str] = "g/g²"
    breaker: ClassVar[str] = "points at more accelerations, in both mountings"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray(a**2, dtype=np.float64)
