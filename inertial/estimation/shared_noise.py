"""Noise that all units of a lot share: an error of the table's angles is common to every unit, dwell by dwell.

Blocks are whitened one by one, as if units were independent. Common noise does not average out over the units: a difference of
chi-square between two effects that are equal in all units scatters by more than its own root, and counts less.
"""

import numpy as np
from numpy.typing import NDArray

from inertial import decisions
from inertial.estimation.comparison import estimate
from inertial.estimation.heldout import residuals
from inertial.estimation.model import Model
from inertial.estimation.term import Term

Array = NDArray[np.float64]


def shared_factor(model: Model, term: Term) -> float:
    """Factor, 1 at least, by which common noise widens the scatter of the separation of a term from its rivals.

    One for an effect with different signs from unit to unit, up to the number of units for one that is equal in all.

    Parameters
    ----------
    model : with the term in it; its residual is the noise
    """
    problem = model.problem
    units = problem.lot.state.time.shape[0]
    if units < 2 or problem.lot.radial:
        return 1.0
    together = _together(model, units)
    return 1.0 + (units - 1) * together * (1.0 if term.shared else _alike(model, term, units))


def _together(model: Model, units: int) -> float:
    """Correlation of the residuals between units, on the same axis; zero if within chance."""
    problem = model.problem
    left = np.nan_to_num(residuals(problem, model.terms, np.ones(problem.n, dtype=bool)) / problem.error)
    correlation = _pairwise(left.reshape(units, -1))
    chance = 1.0 / np.sqrt(left.size / units * units * (units - 1) / 2.0)
    return correlation if correlation > decisions.UNITS_TOGETHER * chance else 0.0


def _alike(model: Model, term: Term, units: int) -> float:
    """Part of a term that is equal in every unit, 0 … 1."""
    fit = estimate(model)
    at = 0
    for other in (t for t in model.terms if not t.shared):
        columns = model.problem.columns(other.effect, other.keywords)[..., : other.first]
        if other.effect.id == term.effect.id:
            series = np.einsum("bnp,bp->bn", columns, fit.local[:, at : at + columns.shape[-1]])
            series = (series - series.mean(axis=1, keepdims=True)) / model.problem.error
            return max(_pairwise(series.reshape(units, -1)), 0.0)
        at += columns.shape[-1]
    return 1.0


def _pairwise(series: Array) -> float:
    """Mean correlation between the rows (units, m), by their common size."""
    units = len(series)
    whole = float(np.sum(series**2))
    return 0.0 if whole <= 0.0 else (float(np.sum(series.sum(axis=0) ** 2)) / whole - 1.0) / (units - 1)
