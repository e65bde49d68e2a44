"""A quadratic nonlinearity of the unit."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect


class SecondOrder(ShockEffect):
    """A quadratic nonlinearity of the unit."""

    id: ClassVar[str] = "second_order"
    equation: ClassVar[str] = "K2·r²"
    source: ClassVar[str] = "IEEE Std 1293, K2"
    breaker: ClassVar[str] = "shocks in both directions and at several peaks"

    def unit(self) -> str:
        """Unit of the coefficient or of the first parameter."""
        return "g/g²"

    def added(self, wave: Array, rate_hz: float) -> Array:
        """The waveform (n,) of a coefficient of 1."""
        return np.asarray(wave**2)
