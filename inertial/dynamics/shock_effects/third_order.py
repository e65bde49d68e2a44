import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect


class ThirdOrder(ShockEffect):
    """A cubic nonlinearity of the unit, or a range that saturates softly."""

    equation = "K3·r³"
    source = "IEEE Std 1293, K3"
    unit = "g/g³"
    breaker = "shocks at several peaks"

    def added(self, wave: Array, rate_hz: float) -> Array:
        return np.asarray(wave**3)
