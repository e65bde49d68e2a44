from typing import ClassVar

import numpy as np

from inertial.dynamics.centrifuge_effects.base import Array, CentrifugeEffect, Spins


class ScaleDrift(CentrifugeEffect):
    """A sensitivity that drifts during the test, as by the heat of windage."""

    id: ClassVar[str] = "scale_drift"
    equation: ClassVar[str] = "s·t·a"
    source: ClassVar[str] = "mechanism: windage heats the units"
    unit: ClassVar[str] = "g/g over the test"
    breaker: ClassVar[str] = "the temperature of the unit logged; the speeds in another order"

    def column(self, points: Spins) -> Array:
        a = points.acceleration
        return np.asarray((points.order - 0.5) * a, dtype=np.float64)
