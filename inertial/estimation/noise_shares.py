"""The noise of a lot: shares of 1/f and of random walk over the white variance, and the scale of every block.

Each block's variance comes from a scaled inverse chi-square distribution whose degrees of freedom and centre are estimated from
the lot (Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) 3): equal units share one variance, a noisy unit keeps its own.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import gammaln

from inertial.arrays import Array
from inertial.decisions import PRIOR_BETTER, PRIOR_DOF

LONGEST = 1500
"""Largest number of dwells with a model of wander: its covariance must fit into memory. Long runs are averaged before."""


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


def deviance_of(squares: Array, dof: Array) -> float:
    """−2 log likelihood of blocks' sums of squares, at the best prior."""
    return min(_deviance_at(squares, dof, prior)[0] for prior in (*PRIOR_DOF, np.inf))


def moderated(squares: Array, dof: Array) -> tuple[Array, float]:
    """Variances (blocks,), and the prior degrees of freedom; one variance for all if that is not clearly worse.

    Parameters
    ----------
    squares, dof : (blocks,), whitened sums of squares and their degrees of freedom
    """
    together, pooled = _deviance_at(squares, dof, np.inf)
    tried = [(*_deviance_at(squares, dof, prior), prior) for prior in PRIOR_DOF] if squares.size > 1 else []
    best = min(tried, default=None)
    if best is None or together - best[0] < PRIOR_BETTER:
        return np.full(squares.size, max(pooled, 1e-30)), np.inf
    _, centre, prior = best
    return np.maximum((squares + prior * centre) / (dof + prior), 1e-30), prior


def _deviance_at(squares: Array, dof: Array, prior: float) -> tuple[float, float]:
    """−2 log likelihood at so many prior degrees of freedom, and the centre of the variances."""
    squares = np.maximum(squares, 0.0)  # those of a block that is fitted exactly can lie below by rounding
    total = float(np.sum(dof))
    pooled = max(float(np.sum(squares)) / max(total, 1.0), 1e-300)
    if not np.isfinite(prior):
        return total * (np.log(2.0 * pooled) + 1.0), pooled
    centre = pooled
    for _ in range(60):
        again = squares.size / float(np.sum((dof + prior) / (squares + prior * centre)))
        if abs(again / centre - 1.0) < 1e-5:
            break
        centre = again
    terms = (dof + prior) * np.log(squares + prior * centre) - prior * np.log(prior * centre)
    terms = terms - 2.0 * gammaln(0.5 * (dof + prior)) + 2.0 * gammaln(0.5 * prior)
    return float(np.sum(terms)), centre
