"""Irreversible effects: relaxation of stress."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stations.plant.hidden.base import Untouched

if TYPE_CHECKING:
    from stations.plant.hidden.base import Array, Block


@dataclass
class StressRelaxation(Untouched):
    """Relaxation of assembly stress, with power or without: time constants spread over decades."""

    size: float = 100e-6  # g, relaxed in each factor e of time
    shortest: float = 300.0  # s
    longest: float = 3e6

    def output(self, force: Array, block: Block) -> Array:
        """Relaxation since the start of the run."""
        count = 1 + math.ceil(2.0 * math.log(self.longest / self.shortest))
        times = np.geomspace(self.shortest, self.longest, count)
        each = self.size * math.log(times[1] / times[0])
        relaxed = each * np.sum(1.0 - np.exp(-block.time[:, None] / times), axis=1)
        return np.broadcast_to(relaxed[:, None, None], force.shape)


@dataclass
class StepChange(Untouched):
    """Sudden relaxation: the bias jumps once, at ``at`` seconds on the clock of the station."""

    size: float = 300e-6  # g
    at: float = 3000.0

    def output(self, force: Array, block: Block) -> Array:
        """The bias step."""
        jump = np.where(block.time >= self.at, self.size, 0.0)
        return np.broadcast_to(jump[:, None, None], force.shape)
