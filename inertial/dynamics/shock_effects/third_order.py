"""A cubic nonlinearity of the unit, or a range that saturates softly."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from inertial.dynamics.shock_effects.base import Array, ShockEffect


class ThirdOrder(ShockEffect):
    """A cubic nonlinearity of the unit, or a range that saturates softly."""

    id: ClassVar[str] = "third_order"
    equation: ClassVar[str] = "K3·r³"
    source: ClassVar[str] = "IEEE Std 1293, K3"
    breaker: ClassVar[str] = "shocks at several peaks"

    def unit(self) -> str:
        """Unit of the coefficient or of the first parameter."""
        return "g/g³"

    def added(self, wave: Array, rate_hz: float) -> Array:
        """The waveform (n,) of a coefficient of 1."""
        return np.asarray(wave**3)
