"""Coefficients of a model by generalised least squares, and what they leave of the run they came from and of a fresh one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.model import Model, Term
from inertial.criticism.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """Coefficients of a model's terms in the blocks of a problem, from data whitened for white noise and wander.

    local : (blocks, p), shared : (q,), g per unit of the column; standard errors likewise. Behind the terms' own coefficients
    stand those of the unknown state before the first dwell, which belong to this run alone.
    """

    terms: tuple[Term, ...]
    local: Array
    shared: Array
    local_error: Array
    shared_error: Array


def estimate(model: Model) -> Estimate:
    """Coefficients at the model's own share of wander."""
    spread = model.problem.basis.spread(model.share)[..., None]
    x, z = model.local / spread, model.shared / spread
    y = model.problem.y / spread[..., 0]
    size = np.sqrt(np.einsum("bnp,bnp->bp", x, x))
    size = np.where(size > 0.0, size, 1.0)
    unit = x / size[:, None, :]
    inverse: Array = np.linalg.pinv(np.swapaxes(unit, -1, -2) @ unit, rcond=1e-10, hermitian=True).astype(np.float64)
    shared, shared_error = np.zeros(0), np.zeros(0)
    variance = model.space.variance
    if z.shape[-1]:
        free = _free(unit, inverse, z)
        target = _free(unit, inverse, y[..., None])[..., 0]
        flat = free.reshape(-1, z.shape[-1])
        shared = np.linalg.lstsq(flat, target.reshape(-1), rcond=1e-9)[0].astype(np.float64)
        shared_error = np.sqrt(variance * np.diag(np.linalg.pinv(flat.T @ flat, rcond=1e-12)))
        y = y - z @ shared
    right = np.einsum("bnp,bn->bp", unit, y)
    local = np.einsum("bpr,br->bp", inverse, right) / size
    errors = np.sqrt(variance * np.diagonal(inverse, axis1=-2, axis2=-1)) / size
    return Estimate(model.terms, local, shared, errors, shared_error)


def _free(unit: Array, inverse: Array, columns: Array) -> Array:
    """Columns less what the local ones explain."""
    return columns - unit @ (inverse @ (np.swapaxes(unit, -1, -2) @ columns))


def residuals_of(problem: Problem, found: Estimate) -> Array:
    """Residuals (blocks, n) in g of a problem under given coefficients; NaN where a dwell is missing."""
    local = [t for t in found.terms if t.effect.scope != "station"]
    shared = [t for t in found.terms if t.effect.scope == "station"]
    left = problem.series.copy()
    if local:
        columns = _columns(problem, local)
        left -= np.einsum("bnp,bp->bn", columns, found.local[:, : columns.shape[-1]])
    if shared:
        columns = _columns(problem, shared)
        left -= columns @ found.shared[: columns.shape[-1]]
    return np.where(np.isfinite(problem.basis.error), left, np.nan)


def _columns(problem: Problem, terms: Sequence[Term]) -> Array:
    return np.concatenate([problem.columns(t.effect, t.keywords)[..., : t.first] for t in terms], axis=-1)


def rms(values: Array) -> float:
    """Root mean square of the values that are there."""
    return float(np.sqrt(np.nanmean(values**2)))
