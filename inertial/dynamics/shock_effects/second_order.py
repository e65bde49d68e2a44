import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect


class SecondOrder(ShockEffect):
    """A quadratic nonlinearity of the unit."""

    equation = "K2·r²"
    source = "IEEE Std 1293, K2"
    unit = "g/g²"
    breaker = "shocks in both directions and at several peaks"

    def added(self, wave: Array, rate_hz: float) -> Array:
        return np.asarray(wave**2)
