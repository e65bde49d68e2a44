from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class Hysteresis(CentrifugeEffect):
    """An output that differs between rising and falling speed."""

    id: ClassVar[str] = "hysteresis"
    equation: ClassVar[str] = "h·a for falling speed"
    source: ClassVar[str] = "mechanism: the sensing element or the arm returns late"
    unit: ClassVar[str] = "g/g"
    breaker: ClassVar[str] = "the same speeds up and down again"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray(points.slowing * a, dtype=np.float64)
