"""What happens once and does not go back: stress that lets go."""

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
    """Stress of the assembly that lets go over barriers of every height, with power or without: times spread over decades."""

    size: float = 100e-6  # g, let go in each factor of e of time
    shortest: float = 300.0  # s
    longest: float = 3e6

    def output(self, force: Array, block: Block) -> Array:
        """What has been let go since the run began."""
        count = 1 + math.ceil(2.0 * math.log(self.longest / self.shortest))
        times = np.geomspace(self.shortest, self.longest, count)
        each = self.size * math.log(times[1] / times[0])
        gone = each * np.sum(1.0 - np.exp(-block.time[:, None] / times), axis=1)
        return np.broadcast_to(gone[:, None, None], force.shape)


@dataclass
class StepChange(Untouched):
    """A stress lets go: the bias jumps once, at ``at`` seconds on the station's clock."""

    size: float = 300e-6  # g
    at: float = 3000.0

    def output(self, force: Array, block: Block) -> Array:
        """The jump."""
        jump = np.where(block.time >= self.at, self.size, 0.0)
        return np.broadcast_to(jump[:, None, None], force.shape)
