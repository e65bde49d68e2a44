from typing import ClassVar

import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect


class SecondOrder(ShockEffect):
    """A quadratic nonlinearity of the unit."""

    id: ClassVar[str] = "second_order"
    equation: ClassVar[str] = "K2·r²"
    source: ClassVar[str] = "IEEE Std 1293, K2"
    unit: ClassVar[str] = "g/g²"
    breaker: ClassVar[str] = "shocks in both directions and at several peaks"

    def added(self, wave: Array, rate_hz: float) -> Array:
        return np.asarray(wave**2)
