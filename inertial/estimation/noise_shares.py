"""The noise of a lot: shares of 1/f and of random walk over the white variance, and the scale of every block."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Shares(NamedTuple):
    """Variances of 1/f and of random walk at the end of the record, over the lot's white variance.

    own : block, and its variances of 1/f and of random walk, for blocks whose wander is of another kind than the lot's
    """

    flicker: float = 0.0
    walk: float = 0.0
    own: tuple[tuple[int, float, float], ...] = ()

    @property
    def common(self) -> "Shares":
        """Those of the lot, without blocks that have their own."""
        return Shares(self.flicker, self.walk)

    def of_block(self, block: int) -> "Shares":
        """Those of one block: its own, or the lot's."""
        return next((Shares(flicker, walk) for own, flicker, walk in self.own if own == block), self.common)

    def pick(self, blocks: list[int]) -> "Shares":
        """The shares of some blocks, numbered as they are given."""
        if not self.own:
            return self
        by_block = {block: rest for block, *rest in self.own}
        own = [(place, *by_block[block]) for place, block in enumerate(blocks) if block in by_block]
        return self._replace(own=tuple(own))

    def times(self, flicker: float, walk: float) -> "Shares":
        """Each share times a factor of its kind."""
        own = tuple((block, flicker * one, walk * other) for block, one, other in self.own)
        return Shares(flicker * self.flicker, walk * self.walk, own)


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
        return Noise(self.shares.pick(blocks), self.scale[blocks], self.prior)
