"""Moisture in the package: the die-attach adhesive absorbs water and swells, which shifts the bias."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from stations.plant.hidden.base import Untouched

if TYPE_CHECKING:
    from stations.plant.hidden.base import Array, Block

MIDDLE_PCT = 45.0
SITES = 0.35  # fraction of the uptake that is bound at sites and saturates first


@dataclass
class MoistureSwelling(Untouched):
    """Adhesive in equilibrium with the air: ``swelling`` g of bias from dry to saturated, by dissolved and by bound water.

    Dual sorption: dissolved water is proportional to humidity (Henry), bound water fills sites (Langmuir). The sensitivity
    of each axis differs from device to device.
    """

    swelling: float = 2e-3
    _sensitivity: Array = field(default_factory=lambda: np.ones((1, 3)), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Draws the sensitivity of each axis of each device."""
        self._sensitivity = stream.choice([-1.0, 1.0], (units, 3)) * stream.uniform(0.6, 1.4, (units, 3))

    def output(self, force: Array, block: Block) -> Array:
        """Bias relative to that at the usual humidity."""
        swollen = _uptake(block.humidity / 100.0) - _uptake(np.array(MIDDLE_PCT / 100.0))
        return self.swelling * swollen[:, None, None] * self._sensitivity


def _uptake(humidity: Array) -> Array:
    """Absorbed water relative to saturation, at a relative humidity from 0 to 1."""
    bound = humidity / (humidity + 0.5) * 1.5
    return np.asarray((1.0 - SITES) * humidity + SITES * bound, dtype=np.float64)
