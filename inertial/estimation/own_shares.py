"""Blocks whose wander is of another kind than the lot's: telegraph noise of one axis, a unit that drifts by itself.

Shares of 1/f and of random walk are common to a lot, as equal sensors have equal noise. An axis that jumps between two levels,
or wanders where the others only flicker, has whitened residuals that follow one another; with the shares of the lot its jumps
are steps of many standard deviations, and a slow effect with a coefficient for every axis takes them up. Such a block gets
shares of its own, by its own restricted likelihood, in every model that is judged: with an effect in the model that explains
the block, its residuals no longer deviate, and the block has the lot's shares again.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from inertial.decisions import OWN_SHARES, OWN_SUSPECT
from inertial.estimation.noise import LONGEST
from inertial.estimation.noise_shares import Shares
from inertial.estimation.problem import Problem
from inertial.estimation.shares import best_shares
from inertial.estimation.space import Space

Array = NDArray[np.float64]

FEWEST = 20
"""Degrees of freedom of a block from which its own shares are estimated."""

_LAGS = 3
_STRIDE = 4
"""Eighths of a decade by which own shares are searched: half decades."""


def own_shares(
    problem: "Problem", series: Array, local: Array, space: "Space", of_block: Callable[[int, Shares], float | None]
) -> tuple[tuple[int, float, float], ...]:
    """Blocks with shares of their own, and these, for the residuals of a model at the lot's shares.

    Parameters
    ----------
    series : (blocks, n), measurements less what columns that blocks share explain, g
    local : (blocks, n, p), columns with coefficients by block
    space : of the model at the lot's shares, or at shares some blocks of which are their own
    of_block : −2 log restricted likelihood of a block at shares, less the log-determinant, where products give it; else None
    """
    if problem.lot.radial or problem.n > LONGEST:
        return ()
    before = {block for block, _, _ in space.noise.shares.own}
    suspect = before | set(np.flatnonzero(_follow(space) > OWN_SUSPECT).tolist())
    dof = space.by_block
    common = space.noise.shares.common
    own: list[tuple[int, float, float]] = []
    for block in sorted(suspect):
        if dof[block] < FEWEST:
            continue
        columns = np.concatenate([local[block], series[block][:, None]], axis=1)

        def deviance(shares: Shares, block: int = block, columns: Array = columns) -> float:
            quick = of_block(block, shares)
            return (
                _deviance(problem, block, columns, shares)
                if quick is None
                else problem.covariance.whitener_of_block(block, shares).logdet + quick
            )

        best = best_shares(deviance, common, finest=_STRIDE)
        if deviance(common) - deviance(best) > OWN_SHARES:
            own.append((block, best.flicker, best.walk))
    return tuple(own)


def _follow(space: "Space") -> Array:
    """By how much the whitened residuals of each block follow one another: Box-Pierce over the first lags, χ² of as many."""
    there = space.covariance.there
    left = np.where(there, space.residual, 0.0)
    squares = np.maximum(np.einsum("bn,bn->b", left, left), 1e-300)
    count = there.sum(axis=1)
    lags = [np.einsum("bn,bn->b", left[:, lag:], left[:, :-lag]) / squares for lag in range(1, _LAGS + 1)]
    return count * np.sum(np.square(lags), axis=0)


def _deviance(problem: "Problem", block: int, columns: Array, shares: Shares) -> float:
    """−2 log restricted likelihood of one block, its columns and behind them its measurements (n, p + 1), at shares."""
    covariance = problem.covariance
    there = covariance.there[block]
    whitener = covariance.whitener_of_block(block, shares)
    white = whitener.columns(columns[None])[0, there] / covariance.level[block]
    size = np.linalg.norm(white[:, :-1], axis=0)
    seen = size > 0.0
    upper = np.linalg.qr(np.concatenate([white[:, :-1][:, seen] / size[seen], white[:, -1:]], axis=1), mode="r")
    diagonal = np.abs(np.diagonal(upper))
    determined = diagonal[:-1] > 1e-6
    dof = int(there.sum()) - int(determined.sum())
    information = 2.0 * float(np.sum(np.log(diagonal[:-1][determined] * size[seen][determined])))
    return whitener.logdet + information + dof * float(np.log(max(diagonal[-1] ** 2, 1e-300)))
