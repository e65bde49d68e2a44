"""Springs with a quadratic and a cubic term that show within 1 g, for units whose sheet has none of the size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stations.plant.device import stream
from stations.plant.hidden.base import Block, HiddenEffect

Array = np.ndarray[Any, np.dtype[np.float64]]
LEAST, MOST = 2e-3, 4e-3  # g at 1 g, far above the uncertainty of a whole turn


def bends(seed: int, serial: str) -> tuple[Array, Array]:
    """Quadratic (3,), 1/g, and cubic (3,), 1/g², of a unit of a lot, each of either sign."""
    drawn = stream(seed, serial, "bends").uniform(-1.0, 1.0, (2, 3))
    quadratic, cubic = np.sign(drawn) * (LEAST + (MOST - LEAST) * np.abs(drawn))
    return quadratic, cubic


class BentSprings(HiddenEffect):
    """The springs of the units of a lot."""

    def __init__(self, seed: int, serials: Sequence[str]) -> None:
        drawn = [bends(seed, serial) for serial in serials]
        self._quadratic, self._cubic = (np.stack([one[k] for one in drawn]) for k in (0, 1))

    def output(self, force: Array, block: Block) -> Array:
        """What the springs add, (n, s, 3), g."""
        return self._quadratic * force**2 + self._cubic * force**3
