from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class BiasDrift(CentrifugeEffect):
    """A bias that drifts during the test."""

    id: ClassVar[str] = "bias_drift"
    equation: ClassVar[str] = "d·t"
    source: ClassVar[str] = "mechanism: temperature or ageing during the test"
    unit: ClassVar[str] = "g over the test"
    breaker: ClassVar[str] = "bias before and after at rest; the speeds in another order"

    def column(self, points: Spins) -> Array:
        return np.asarray(points.order - 0.5, dtype=np.float64)
