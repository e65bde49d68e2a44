"""Coefficients of a model, and their residuals on their own run, on dwells that were left out, and on a fresh run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array, Flags
from inertial.estimation.bases import unit_columns
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term
from inertial.state import History


@dataclass(frozen=True)
class Estimate:
    """Coefficients of a model's terms in the blocks of a problem, from data whitened for white noise and wander.

    local : (blocks, p), shared : (q,), g per unit of the column; shared_error : (q,), standard errors

    The coefficients of the unknown state before the first dwell follow those of the terms; a run of the same plan is assumed to
    start in the same state.
    """

    terms: tuple[Term, ...]
    local: Array
    shared: Array
    shared_error: Array


def estimate(model: Model) -> Estimate:
    """Coefficients at the model's own noise."""
    space = model.space
    x, z = space.local, space.whiten(model.shared)
    y = space.whiten(model.problem.y[..., None])[..., 0]
    unit, size = unit_columns(x)
    inverse: Array = np.linalg.pinv(np.swapaxes(unit, -1, -2) @ unit, rcond=CONDITION, hermitian=True).astype(
        np.float64
    )
    shared, shared_error = np.zeros(0), np.zeros(0)
    variance = space.variance
    if z.shape[-1]:
        free = _beyond_local(unit, inverse, z)
        target = _beyond_local(unit, inverse, y[..., None])[..., 0]
        flat = free.reshape(-1, z.shape[-1])
        shared = np.linalg.lstsq(flat, target.reshape(-1), rcond=1e-9)[0].astype(np.float64)
        # nearly collinear columns can give diagonals slightly below zero by rounding
        inverted = np.diag(np.linalg.pinv(flat.T @ flat, rcond=1e-12))
        shared_error = np.sqrt(variance * np.maximum(inverted, 0.0))
        y = y - z @ shared
    right = np.einsum("bnp,bn->bp", unit, y)
    scaled = np.einsum("bpr,br->bp", inverse, right)
    scaled = _shrunk_to_lot(model, unit, right, scaled, variance * inverse, size)
    return Estimate(model.terms, scaled / size, shared, shared_error)


CONDITION = 1e-8
"""Relative eigenvalue of the scaled normal matrix below which a direction, due to scatter of the angles, gets no coefficient."""

OWN = ("bias", "scale", "misalignment", "turn_on_bias")
"""Effects whose coefficients differ from unit to unit by nature: they are not shrunk towards the lot's mean."""

_FEW_UNITS = 4

_VANISHED = 1e-100
"""Size of a whitened column below which its squares leave the range of numbers."""


def _shrunk_to_lot(model: Model, unit: Array, right: Array, scaled: Array, covariance: Array, size: Array) -> Array:
    """Scaled coefficients (blocks, p), shrunk towards the lot's mean by their errors relative to their scatter over the units.

    Empirical Bayes with the moments of the lot (Efron & Morris, J. Am. Stat. Assoc. 70 (1975) 311): a coefficient that the run
    determines poorly, and that is similar in units of one type, is predicted better from all units.
    """
    problem = model.problem
    units = problem.lot.state.time.shape[0]
    if units < _FEW_UNITS or problem.lot.radial:
        return scaled
    # a column that has died away (a warm-up of seconds, hours later) has no coefficient to shrink
    seen = size > _VANISHED
    free = _shrinkable(model, scaled.shape[-1]) & seen
    size = np.where(seen, size, 1.0)
    value = np.where(seen, scaled / size, 0.0)
    error2 = np.diagonal(covariance, axis1=-2, axis2=-1) / size**2
    by_axis = value.reshape(units, problem.per_unit, -1)
    mean = by_axis.mean(axis=0)
    scatter = ((by_axis - mean) ** 2).sum(axis=(0, 1)) / (problem.per_unit * (units - 1.0))
    between = np.maximum(scatter - error2.mean(axis=0), 1e-3 * error2.mean(axis=0))
    variance = model.space.variance
    there = free & (between > 0.0)
    precision = np.where(there, variance / (np.where(there, between, 1.0) * size**2), 0.0)
    gram = np.swapaxes(unit, -1, -2) @ unit + np.einsum("bp,pr->bpr", precision, np.eye(size.shape[-1]))
    centre = np.tile(mean, (units, 1)) * size
    drawn = np.linalg.pinv(gram, rcond=CONDITION, hermitian=True) @ (right + precision * centre)[..., None]
    return drawn[..., 0].astype(np.float64)


def _shrinkable(model: Model, count: int) -> Flags:
    """The local coefficients that are shrunk: those of the effects beyond bias, scale and misalignment."""
    flags = np.zeros(count, dtype=bool)
    for term, columns in model.slices(shared=False):
        flags[columns] = term.effect.id not in OWN
    return flags


def _beyond_local(unit: Array, inverse: Array, columns: Array) -> Array:
    """Columns (blocks, n, m) after projection on the local columns ``unit`` (blocks, n, p)."""
    return columns - unit @ (inverse @ (np.swapaxes(unit, -1, -2) @ columns))


def residuals_of(problem: Problem, fit: Estimate) -> Array:
    """Residuals (blocks, n) in g of a problem under given coefficients; NaN where a dwell is missing."""
    local = [t for t in fit.terms if not t.shared]
    shared = [t for t in fit.terms if t.shared]
    left = problem.y - np.einsum("bnp,bp->bn", _with_start(problem, local), fit.local)
    if shared:
        left -= _with_start(problem, shared) @ fit.shared
    return np.where(np.isfinite(problem.error), left, np.nan)


def _columns(problem: Problem, terms: Sequence[Term]) -> Array:
    """Columns (blocks, n, p) of terms, without those of the unknown state of their memory."""
    columns = [t.columns(problem) for t in terms]
    return np.concatenate(columns, axis=-1) if columns else np.zeros((problem.blocks, problem.n, 0))


def _with_start(problem: Problem, terms: Sequence[Term]) -> Array:
    """Columns (blocks, n, p) of terms, then those of the unknown state of their memory."""
    return np.concatenate([_columns(problem, terms), *(t.start(problem) for t in terms)], axis=-1)


def rms(values: Array) -> float:
    """Root mean square of the values that are not missing."""
    return float(np.sqrt(np.nanmean(values**2)))


def residuals(problem: Problem, terms: Sequence[Term], train: Flags) -> Array:
    """Residuals (blocks, n) in g of least squares on some dwells, weighted by the white standard errors.

    Parameters
    ----------
    train : (n,), dwells that are fitted; all are predicted
    """
    left = Fitting(problem, terms).left(problem.y[..., None], train)[..., 0]
    return np.where(np.isfinite(problem.error), left, np.nan)


class Fitting:
    """A model's columns in a problem, ready to be fitted to some dwells of any series.

    start : whether the unknown state of memories before the first dwell is fitted as well
    """

    def __init__(self, problem: Problem, terms: Sequence[Term], *, start: bool = False) -> None:
        of_terms = _with_start if start else _columns
        self._x = of_terms(problem, [t for t in terms if not t.shared])
        self._z = of_terms(problem, [t for t in terms if t.shared])
        self._weight = np.where(np.isfinite(problem.error), 1.0 / problem.error, 0.0)

    def left(self, series: Array, train: Flags) -> Array:
        """Residuals of a fit to the dwells ``train`` (n,) on series (blocks, n, m), on all dwells."""
        x, z, weight = self._x, self._z, self._weight * train
        solve = _solver(x, weight)
        if z.shape[-1]:
            free = (z - x @ solve(z)) * weight[..., None]
            target = (series - x @ solve(series)) * weight[..., None]
            flat = free.reshape(-1, free.shape[-1])
            series = series - z @ np.linalg.lstsq(flat, target.reshape(flat.shape[0], -1), rcond=1e-9)[0]
        return series - x @ solve(series)


def fitted_residuals(model: Model) -> Array:
    """Residuals (blocks, n), g, of a model on the dwells it is fitted to; all printed and plotted residuals are these.

    They are those of least squares weighted by the white standard errors, which do not depend on the assumed wander: where wander
    has absorbed a missing effect, generalised least squares leaves larger residuals. With unknown poses they are those of the
    published fit.
    """
    problem = model.problem
    if problem.lot.radial:
        return residuals_of(problem, estimate(model))
    fitting = Fitting(problem, model.terms, start=True)
    left = fitting.left(problem.y[..., None], np.ones(problem.n, dtype=bool))[..., 0]
    return np.where(np.isfinite(problem.error), left, np.nan)


def _solver(x: Array, weight: Array) -> Callable[[Array], Array]:
    """A function from targets (blocks, n, m) to their coefficients (blocks, p, m), by weighted least squares on ``x``.

    x : (blocks, n, p), columns; weight : (blocks, n)
    """
    unit, size = unit_columns(x * weight[..., None])
    across = np.swapaxes(unit, -1, -2)
    inverse = np.linalg.pinv(across @ np.swapaxes(across, -1, -2), rcond=1e-9, hermitian=True)
    return lambda target: (inverse @ (across @ (target * weight[..., None]))) / size[..., None]


_WARMER = 0.5
"""Half step of temperature, K, of the numerical derivative."""


def slope_of(model: Model) -> Array | None:
    """Derivative of the model's output by temperature, (units, n, 3), g/K; None without a temperature in record or model."""
    lot = model.problem.lot
    state = lot.state
    if state.temperature is None or lot.radial:
        return None
    fit = estimate(model)
    ends: list[Array] = []
    for sign in (1.0, -1.0):
        history = (
            None if state.history is None else History(state.history.time, state.history.temperature + sign * _WARMER)
        )
        moved = replace(state, temperature=state.temperature + sign * _WARMER, history=history, memory={})
        problem = Problem(replace(lot, state=moved))
        columns = _columns(problem, [t for t in fit.terms if not t.shared])
        ends.append(np.einsum("bnp,bp->bn", columns, fit.local[:, : columns.shape[-1]]))
    slope = (ends[0] - ends[1]) / (2.0 * _WARMER)
    if float(np.max(np.abs(slope))) <= 0.0:
        return None
    return np.swapaxes(slope.reshape(state.time.shape[0], model.problem.per_unit, -1), 1, 2)
