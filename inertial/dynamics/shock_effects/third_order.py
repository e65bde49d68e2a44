from typing import ClassVar

import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect


class ThirdOrder(ShockEffect):
    """A cubic nonlinearity of the unit, or a range that saturates softly."""

    id: ClassVar[str] = "third_order"
    equation: ClassVar[str] = "K3·r³"
    source: ClassVar[str] = "IEEE Std 1293, K3"
    unit: ClassVar[str] = "g/g³"
    breaker: ClassVar[str] = "shocks at several peaks"

    def added(self, wave: Array, rate_hz: float) -> Array:
        return np.asarray(wave**3)
