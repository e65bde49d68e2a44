"""The noise of a lot: shares of 1/f and of random walk over the white variance, and the scale of every block."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Shares(NamedTuple):
    """Variances of 1/f and of random walk at the end of the record, over the lot's white variance."""

    flicker: float = 0.0
    walk: float = 0.0


@dataclass(frozen=True)
class Noise:
    """Noise of a lot.

    scale : (blocks,), s: ratio of the standard deviations to those of the white errors and shares
    prior : prior degrees of freedom of the blocks' variances; infinite if all are equal
    """

    shares: Shares
    scale: Array
    prior: float = np.inf

    def pick(self, blocks: list[int]) -> "Noise":
        """The noise of some blocks."""
        return Noise(self.shares, self.scale[blocks], self.prior)
