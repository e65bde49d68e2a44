"""Noise that is louder in one soak than in another: most noise of a sensor grows with its temperature.

A lot's covariance has one scale for every unit and axis over the whole run. Where the noise of a hot soak is twice that of a
cold one, the significance of a step between soaks, or of a curve over temperature, is overestimated. The scale of each soak is
therefore estimated before any effect is searched, from the residuals of a flexible model fitted to each soak separately: bias,
response and products of forces per soak absorb effects of temperature and nonlinearity, and a robust scatter ignores single bad
dwells. The median over the units at each dwell is subtracted, because a wrong pose is not noise.
"""

from itertools import combinations_with_replacement

import numpy as np

from inertial.arrays import Array, Places
from inertial.estimation.alternative import soaks
from inertial.estimation.comparison import estimate
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import LONGEST
from inertial.estimation.scatter import differ

_LEFT = 0.25
"""Share of the dwells of a soak that the model of a soak must leave as degrees of freedom."""

TOGETHER = 4
"""Smallest number of units whose median at a dwell is subtracted as common to all units."""

_DRIFTS = 16
"""Smallest number of dwells of a soak in which a curved drift, not only a linear one, is fitted."""

_FEWEST = 4
"""Smallest number of dwells of a soak whose scatter is estimated."""

_DRAWN = 40_000
"""Number of noise values drawn for the expected log variance of a soak: the mean log variance of few dwells lies far below the
log of the mean variance, and less so for more dwells, so that soaks of unequal length would seem to differ."""


def loudness_of(model: Model, soak: Places | None = None) -> Array | None:
    """Standard deviation of the noise of each dwell over that of the lot, (n,), mean square 1; None if soaks do not differ.

    Parameters
    ----------
    soak : (n,), index of the soak of each dwell, where it must not be taken from the temperatures of the model
    """
    problem = model.problem
    if problem.lot.radial or problem.n > LONGEST or problem.lot.state.temperature is None:
        return None
    soak = soaks(problem.lot.state) if soak is None else soak
    members = [np.flatnonzero(soak == k) for k in range(int(soak.max()) + 1)]
    members = [dwells for dwells in members if dwells.size >= _FEWEST]
    if len(members) < 2:
        return None
    fitted = estimate(model)
    series = problem.y - np.einsum("bnp,bp->bn", model.local, fitted.local)
    if model.shared.shape[-1]:
        series = series - model.shared @ fitted.shared
    ratios = np.stack([_of_soak(model, series, dwells) for dwells in members], axis=1)
    ratios = ratios[np.isfinite(ratios).all(axis=1)]
    if len(ratios) < 2 or not differ(ratios):
        return None
    by_soak = np.median(ratios - ratios.mean(axis=1, keepdims=True), axis=0)
    loud = np.ones(problem.n)
    for dwells, value in zip(members, by_soak, strict=True):
        loud[dwells] = np.exp(0.5 * value)
    return loud / np.sqrt(np.mean(loud**2))


def _of_soak(model: Model, series: Array, dwells: Places) -> Array:
    """Log robust variance (blocks,) of a soak's residuals, less its expectation for the model's noise; NaN if too few dwells."""
    problem, covariance = model.problem, model.problem.covariance
    there = covariance.there[:, dwells]
    force = np.broadcast_to(problem.lot.state.force, (*problem.lot.state.time.shape, 3))[:, dwells]
    time = problem.lot.state.time[:, dwells]
    left = np.full((problem.blocks, dwells.size), np.nan)
    expected = np.full(problem.blocks, np.nan)
    drawn = np.random.default_rng(dwells.size).standard_normal((dwells.size, np.clip(_DRAWN // dwells.size, 50, 1000)))
    before: tuple[Array, Array] | None = None
    q: Array | None = None
    known: dict[tuple[object, ...], float] = {}
    for block in range(problem.blocks):
        present = there[block]
        if np.count_nonzero(present) < _FEWEST:
            continue
        here = force[block // problem.per_unit][present], time[block // problem.per_unit][present]
        if before is None or not all(map(np.array_equal, here, before)):
            # the axes of a unit, and units in the same poses at the same times, have the same columns
            before, x = here, _soak_columns(*here)
            q = None if x is None else np.linalg.qr(x)[0]
            known.clear()
        if q is None:
            continue
        y = series[block, dwells[present]]
        left[block, present] = y - q @ (q.T @ y)
        like = covariance.like_of(block, model.noise)
        if like not in known:
            root = np.linalg.cholesky(covariance.of_dwells(block, model.noise, dwells[present]))
            noise = root @ drawn[: len(root)]
            noise -= q @ (q.T @ noise)
            size = float(covariance.level[block] * model.noise.scale[block])
            known[like] = float(np.mean(np.log(inner_mean(noise.T / size))))
        expected[block] = known[like] + 2.0 * np.log(float(covariance.level[block] * model.noise.scale[block]))
    units = problem.blocks // problem.per_unit
    if units >= TOGETHER:
        by_axis = left.reshape(units, problem.per_unit, -1)
        measured = np.isfinite(by_axis).sum(axis=0) >= TOGETHER
        together = np.zeros(by_axis.shape[1:])
        together[measured] = np.nanmedian(by_axis[:, measured], axis=0)
        left = (by_axis - together).reshape(left.shape)
    with np.errstate(divide="ignore"):
        ratio = np.log(inner_mean(left)) - expected
    return np.where(np.isfinite(left).sum(axis=1) >= _FEWEST, ratio, np.nan)


def inner_mean(left: Array) -> Array:
    """Mean (...,) of the smallest three quarters of the squares of each row (..., n), which excludes single bad dwells."""
    size = np.sort(np.where(np.isfinite(left), left, np.inf) ** 2, axis=-1)
    count = np.maximum((3 * np.isfinite(left).sum(axis=-1)) // 4, 1)
    inner = np.arange(size.shape[-1]) < count[..., None]
    return np.where(inner, size, 0.0).sum(axis=-1) / count


def _soak_columns(force: Array, time: Array) -> Array | None:
    """Orthonormal columns (k, p) of a soak: bias, drift, products of forces; None if too few degrees of freedom remain.

    The degree of the products is the largest, up to three, that leaves enough. A device that had not soaked drifts over the
    soak, which is not noise.
    """
    best = None
    since = (time - time.min()) / max(float(np.ptp(time)), 1e-9)
    drift = [since, since**2, since**3] if len(time) >= _DRIFTS else [since] if len(time) > 2 * _FEWEST else []
    for degree in (1, 2, 3):
        columns = [np.ones(len(force)), *drift]
        for order in range(1, degree + 1):
            columns += [
                np.prod(force[:, list(which)], axis=1) for which in combinations_with_replacement(range(3), order)
            ]
        x = np.stack(columns, axis=1)
        vectors, values, _ = np.linalg.svd(x, full_matrices=False)
        rank = int(np.sum(values > 1e-6 * values[0]))
        if len(force) - rank < max(2.0, _LEFT * len(force)):
            break
        best = vectors[:, :rank]
    return best
