"""Least squares of a model on some dwells, and its residuals on all."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inertial.estimation.problem import Problem
from inertial.estimation.term import Term

Array = NDArray[np.float64]


def residuals(problem: Problem, terms: Sequence[Term], train: NDArray[np.bool_]) -> Array:
    """Residuals (blocks, n) in g of least squares on some dwells, weighted by the white standard errors.

    Parameters
    ----------
    train : (n,), dwells that are fitted; all are predicted
    """
    left = Fitting(problem, terms).left(problem.series[..., None], train)[..., 0]
    return np.where(np.isfinite(problem.error), left, np.nan)


class Fitting:
    """A model's columns in a problem, ready to be fitted to some dwells of any series."""

    def __init__(self, problem: Problem, terms: Sequence[Term]) -> None:
        self._x = _stacked(problem, [t for t in terms if not t.shared])
        self._z = _stacked(problem, [t for t in terms if t.shared])
        self._weight = np.where(np.isfinite(problem.error), 1.0 / problem.error, 0.0)

    def left(self, series: Array, train: NDArray[np.bool_]) -> Array:
        """Residuals of a fit to the dwells ``train`` (n,) on series (blocks, n, m), on all dwells."""
        x, z, weight = self._x, self._z, self._weight * train
        solve = _solver(x, weight)
        if z.shape[-1]:
            free = (z - x @ solve(z)) * weight[..., None]
            target = (series - x @ solve(series)) * weight[..., None]
            flat = free.reshape(-1, free.shape[-1])
            series = series - z @ np.linalg.lstsq(flat, target.reshape(flat.shape[0], -1), rcond=1e-9)[0]
        return series - x @ solve(series)


def fit_rms(problem: Problem, terms: Sequence[Term]) -> float:
    """RMS residual in g of the fit to all dwells."""
    left = residuals(problem, terms, np.ones(problem.n, dtype=bool))
    return float(np.sqrt(np.nanmean(left**2)))


def _stacked(problem: Problem, terms: Sequence[Term]) -> Array:
    columns = [problem.columns(t.effect, t.keywords)[..., : t.first] for t in terms]
    return np.concatenate(columns, axis=-1) if columns else np.zeros((problem.blocks, problem.n, 0))


class _solver:  # noqa: N801  # a function with a prepared factor
    """Coefficients (blocks, p, m) for targets (blocks, n, m) in weighted least squares on columns (blocks, n, p)."""

    def __init__(self, x: Array, weight: Array) -> None:
        weighted = x * weight[..., None]
        self.size = np.sqrt(np.einsum("bnp,bnp->bp", weighted, weighted))
        self.size = np.where(self.size > 0.0, self.size, 1.0)
        self.scaled, self.weight = weighted / self.size[:, None, :], weight
        self.inverse = np.linalg.pinv(np.swapaxes(self.scaled, -1, -2) @ self.scaled, rcond=1e-9, hermitian=True)

    def __call__(self, target: Array) -> Array:
        right = np.swapaxes(self.scaled, -1, -2) @ (target * self.weight[..., None])
        return (self.inverse @ right) / self.size[..., None]
