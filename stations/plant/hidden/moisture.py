# ruff: noqa: ARG002 - an effect is told everything and uses what its physics needs
"""Water in the package: the glue under the die takes it up, swells and pushes the bias."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from stations.plant.hidden.base import Untouched

if TYPE_CHECKING:
    from stations.plant.hidden.base import Array, Block

MIDDLE_PCT = 45.0
SITES = 0.35  # part of the uptake that is bound at few sites and saturates first


@dataclass
class MoistureSwelling(Untouched):
    """Glue in balance with the air: ``swelling`` g of bias from dry to saturated, by dissolved and by bound water.

    Dual sorption: dissolved water goes with the humidity (Henry), bound water fills sites (Langmuir). How far each axis is pushed
    differs from device to device.
    """

    swelling: float = 2e-3
    _push: Array = field(default_factory=lambda: np.ones((1, 3)), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Draws how the die of each device sits in its glue."""
        self._push = stream.choice([-1.0, 1.0], (units, 3)) * stream.uniform(0.6, 1.4, (units, 3))

    def output(self, force: Array, block: Block) -> Array:
        """Bias beside that in a hall of usual humidity."""
        swollen = _uptake(block.humidity / 100.0) - _uptake(np.array(MIDDLE_PCT / 100.0))
        return self.swelling * swollen[:, None, None] * self._push


def _uptake(part: Array) -> Array:
    """Water taken up over that at saturation, for a part of saturation in the air."""
    bound = part / (part + 0.5) * 1.5
    return np.asarray((1.0 - SITES) * part + SITES * bound, dtype=np.float64)
