"""The noise of a lot: shares of 1/f noise and random walk relative to the white variance, and the scale of every block.

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
"""Largest number of dwells for which wander is modelled: its covariance must fit into memory. Long runs are averaged first."""


class Shares(NamedTuple):
    """Variances of 1/f noise and of random walk at the end of the record, over the lot's white variance.

    by_block : (index, 1/f, random walk) of each block with shares of its own instead of the lot's
    """

    flicker: float = 0.0
    walk: float = 0.0
    by_block: tuple[tuple[int, float, float], ...] = ()

    @property
    def common(self) -> "Shares":
        """The shares of the lot, without those of single blocks."""
        return Shares(self.flicker, self.walk)

    def of_block(self, block: int) -> "Shares":
        """The shares of a block: its own, or the lot's."""
        return next((Shares(flicker, walk) for number, flicker, walk in self.by_block if number == block), self.common)

    def pick(self, blocks: list[int]) -> "Shares":
        """The shares of some blocks, renumbered in the given order."""
        if not self.by_block:
            return self
        rest_of = {block: rest for block, *rest in self.by_block}
        of_picked = [(number, *rest_of[block]) for number, block in enumerate(blocks) if block in rest_of]
        return self._replace(by_block=tuple(of_picked))

    def times(self, flicker: float, walk: float) -> "Shares":
        """The shares with those of 1/f and of random walk multiplied by one factor each."""
        of_blocks = tuple((block, flicker * first, walk * second) for block, first, second in self.by_block)
        return Shares(flicker * self.flicker, walk * self.walk, of_blocks)


_EXACT = 1e-9
"""Sum of squares of a block fitted exactly, over the pooled variance: rounding."""


@dataclass(frozen=True)
class Noise:
    """Noise of a lot.

    scale : (blocks,), factor s on the standard deviations that white errors and shares state
    prior : prior degrees of freedom of the blocks' variances; infinite if all variances are equal
    """

    shares: Shares
    scale: Array
    prior: float = np.inf

    def pick(self, blocks: list[int]) -> "Noise":
        """The noise of some blocks."""
        return Noise(self.shares.pick(blocks), self.scale[blocks], self.prior)


def deviance_of(squares: Array, dof: Array) -> float:
    """−2 log likelihood of the sums of squares (blocks,) with degrees of freedom (blocks,), at the best prior."""
    return min(float(np.min(_deviances(squares, dof)[0])), _deviance_of_equal(squares, dof)[0])


def moderated(squares: Array, dof: Array) -> tuple[Array, float]:
    """Variances (blocks,) and prior degrees of freedom; one common variance unless its likelihood is clearly lower.

    Parameters
    ----------
    squares, dof : (blocks,), whitened sums of squares and their degrees of freedom
    """
    together, pooled = _deviance_of_equal(squares, dof)
    if squares.size > 1:
        deviances, centres = _deviances(squares, dof)
        best = int(np.argmin(deviances))
        prior = PRIOR_DOF[best]
        if together - deviances[best] >= PRIOR_BETTER:
            return np.maximum((squares + prior * centres[best]) / (dof + prior), 1e-30), prior
    return np.full(squares.size, max(pooled, 1e-30)), np.inf


def _deviance_of_equal(squares: Array, dof: Array) -> tuple[float, float]:
    """−2 log likelihood of blocks of one variance, and that variance."""
    # rounding can make the sum of squares of an exactly fitted block negative
    total, sum_of_squares = float(np.sum(dof)), float(np.sum(np.maximum(squares, 0.0)))
    pooled = max(sum_of_squares / max(total, 1.0), 1e-300)
    return total * (np.log(2.0 * pooled) + 1.0), pooled


def _deviances(squares: Array, dof: Array, priors: tuple[float, ...] = PRIOR_DOF) -> tuple[Array, Array]:
    """−2 log likelihoods at each of the prior degrees of freedom, and the centres of the variances there, (priors,)."""
    pooled = _deviance_of_equal(squares, dof)[1]
    # a block without any square would draw the centre to zero
    squares, prior = np.maximum(squares, _EXACT * pooled), np.array(priors)[:, None]
    weight = dof + prior
    centre = np.full(prior.shape, pooled)
    # Newton's steps in the logarithm of the centre: plain repetition creeps where the prior is large
    for _ in range(60):
        both = squares + prior * centre
        each = weight / both
        total = np.add.reduce(each, axis=1, keepdims=True)
        step = np.log(squares.size / (total * centre))
        if np.all(np.abs(step) < 1e-5):
            break
        share = np.add.reduce(each * squares / both, axis=1, keepdims=True) / total
        centre = centre * np.exp(np.clip(step / share, -2.0, 2.0))
    terms = weight * np.log(squares + prior * centre) - prior * np.log(prior * centre)
    terms = terms - 2.0 * gammaln(0.5 * weight) + 2.0 * gammaln(0.5 * prior)
    return terms.sum(axis=1), centre[:, 0]
