"""Variances of units and axes, shrunk towards each other as far as they are similar.

Each block's variance comes from a scaled inverse chi-square distribution whose degrees of freedom and centre are estimated from
the lot (Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) 3): equal units share one variance, a noisy unit keeps its own.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from inertial.decisions import PRIOR_BETTER, PRIOR_DOF

Array = NDArray[np.float64]

_TURNS = 60


def deviance(squares: Array, dof: Array) -> float:
    """−2 log likelihood of blocks' sums of squares, at the best prior."""
    return min(_at(squares, dof, prior)[0] for prior in (*PRIOR_DOF, np.inf))


def moderated(squares: Array, dof: Array) -> tuple[Array, float]:
    """Variances (blocks,), and the prior degrees of freedom; one variance for all if that is not clearly worse.

    Parameters
    ----------
    squares, dof : (blocks,), whitened sums of squares and their degrees of freedom
    """
    together, pooled = _at(squares, dof, np.inf)
    tried = [(*_at(squares, dof, prior), prior) for prior in PRIOR_DOF] if squares.size > 1 else []
    best = min(tried, default=None)
    if best is None or together - best[0] < PRIOR_BETTER:
        return np.full(squares.size, max(pooled, 1e-30)), np.inf
    _, centre, prior = best
    return np.maximum((squares + prior * centre) / (dof + prior), 1e-30), prior


def _at(squares: Array, dof: Array, prior: float) -> tuple[float, float]:
    """−2 log likelihood at so many prior degrees of freedom, and the centre of the variances."""
    total = float(np.sum(dof))
    pooled = max(float(np.sum(squares)) / max(total, 1.0), 1e-300)
    if not np.isfinite(prior):
        return total * (np.log(2.0 * pooled) + 1.0), pooled
    centre = pooled
    for _ in range(_TURNS):
        again = squares.size / float(np.sum((dof + prior) / (squares + prior * centre)))
        if abs(again / centre - 1.0) < 1e-5:
            break
        centre = again
    terms = (dof + prior) * np.log(squares + prior * centre) - prior * np.log(prior * centre)
    terms = terms - 2.0 * gammaln(0.5 * (dof + prior)) + 2.0 * gammaln(0.5 * prior)
    return float(np.sum(terms)), centre
