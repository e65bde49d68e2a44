"""Noise of a dwell that depends on the force along the axis, as from a reference voltage or from a floor that tilts the table.

A lot's covariance has one white variance for every unit and axis. Where the variance grows with the force, the residuals of poses
along gravity look like a nonlinear transfer function. The dependence is estimated before any effect is searched, from poses that
were measured several times: the mean of each pose absorbs whatever repeats with the pose, and the median over the units removes
what is common to all units at a dwell. Without repeated poses the dependence cannot be estimated.
"""

from itertools import combinations

import numpy as np

from inertial.arrays import NORMAL_MEDIAN, Array, Places
from inertial.estimation.alternative import soaks
from inertial.estimation.comparison import estimate
from inertial.estimation.loudness import TOGETHER, inner_mean
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import LONGEST
from inertial.estimation.scatter import differ

_SAME_POSE = 0.01
"""Difference of the force, g, below which two dwells are in the same pose."""

_EDGES = (1.0 / 3.0, 2.0 / 3.0)
"""Forces along the axis, in parts of the largest, between which the scatter is compared."""

_FEWEST = 6
"""Smallest number of dwells of an axis in a class of force whose scatter is estimated."""

_LEFT = 0.25
"""Share of the dwells that poses and soaks must leave as degrees of freedom."""

_FAR = 9.0
"""Limit of a squared residual, over the typical square of its class of force: larger ones are clipped to it."""

_LEAST = 0.03
"""Lower bound of a dwell's white variance, over that of its axis."""

_ROUNDS = 5

_DRAWS = 10
"""Draws of noise for each unit and axis, so that the expectation they give is surer than what it is compared with."""

_REPEATED = 1e-6
"""Smallest share of a dwell's variance that poses and soaks leave where its pose was measured again."""


def by_force(model: Model, soak: Places | None = None) -> Array | None:
    """White standard deviation of each dwell over that of its axis, (units, n, axes); None if it does not depend on force.

    Parameters
    ----------
    soak : (n,), index of the soak of each dwell, where it must not be taken from the temperatures of the model
    """
    problem, covariance = model.problem, model.problem.covariance
    units, n = problem.lot.state.time.shape
    if problem.lot.radial or n > LONGEST:
        return None
    soak = soaks(problem.lot.state) if soak is None else soak
    force = np.broadcast_to(problem.lot.state.force, (units, n, 3))
    q = _pose_and_soak_basis(force[0], np.broadcast_to(problem.lot.state.time, (units, n))[0], soak)
    complete = covariance.there.reshape(units, -1).all(axis=1)
    if q is None or not complete.any():
        return None
    complete_blocks = np.repeat(complete, problem.per_unit)
    fitted = estimate(model)
    series = problem.y - np.einsum("bnp,bp->bn", model.local, fitted.local)
    if model.shared.shape[-1]:
        series = series - model.shared @ fitted.shared
    left = series - (series @ q) @ q.T
    if np.count_nonzero(complete) >= TOGETHER:
        by_axis = left.reshape(units, problem.per_unit, n)
        left = (by_axis - np.median(by_axis[complete], axis=0)).reshape(left.shape)
    along = np.abs(np.swapaxes(force, 1, 2)[:, list(problem.axes)].reshape(problem.blocks, n))
    if not along.any():
        return None  # an axis across gravity in every pose
    along = along / float(along.max())
    scale = (covariance.level * model.noise.scale)[:, None] ** 2
    alone = (problem.error / covariance.level[:, None]) ** 2 * scale
    projector = np.eye(n) - q @ q.T
    slow = _projected_slow_variance(model, projector) * scale
    alone[~complete_blocks] = alone[complete_blocks].mean()
    judged = np.ix_(np.flatnonzero(complete_blocks), np.flatnonzero(np.diagonal(projector) > _REPEATED))
    classes = np.digitize(along[judged], _EDGES)
    filled = [k for k in range(len(_EDGES) + 1) if np.all(np.sum(classes == k, axis=1) >= _FEWEST)]
    if len(filled) < 2 or len(classes) < 2:
        return None
    sizes = _log_squares((left**2 / (alone @ projector**2 + slow))[judged], classes, filled)
    if not differ(sizes - _expected_log_squares(model, projector, judged, classes, filled)):
        return None
    variance = np.ones_like(left)
    for _ in range(_ROUNDS):  # iterated, because each residual contains noise of the other dwells
        white = (alone * variance) @ projector**2
        ratio = (left**2 / (white + slow))[judged]
        ratio /= ratio.mean(axis=1, keepdims=True)
        curve = _variance_at(along[judged], np.minimum(ratio, _clipping_limits(ratio, along[judged])), along)
        variance *= np.maximum((curve * (white + slow) - slow) / white, _LEAST)
        variance = np.maximum(variance / np.mean(variance, axis=1, keepdims=True), _LEAST)
    return np.swapaxes(np.sqrt(variance).reshape(units, problem.per_unit, n), 1, 2)


def _pose_and_soak_basis(force: Array, time: Array, soak: Places) -> Array | None:
    """Orthonormal columns (n, p): mean per pose; bias, drift, response per soak; None if they leave too few dwells."""
    n = len(force)
    pose = np.full(n, -1)
    for k in range(n):
        if pose[k] < 0:
            pose[(pose < 0) & (np.abs(force - force[k]).max(axis=1) < _SAME_POSE)] = k
    columns = [np.equal(pose, k).astype(np.float64) for k in np.unique(pose)]
    for k in np.unique(soak):
        inside = (soak == k).astype(np.float64)
        since = inside * (time - time[soak == k].mean()) / max(float(np.ptp(time)), 1e-9)
        columns += [inside, since, *(inside * each for each in force.T)]
    vectors, values, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    q = vectors[:, values > 1e-6 * values[0]]
    return q if n - q.shape[1] >= max(_FEWEST, _LEFT * n) else None


def _projected_slow_variance(model: Model, projector: Array) -> Array:
    """Variance (blocks, n) of the model's slow noise after a projector (n, n), over the variance of each block."""
    covariance, dwells = model.problem.covariance, np.arange(model.problem.n)
    known: dict[tuple[object, ...], Array] = {}
    slow = np.empty(model.problem.y.shape)
    for block in range(model.problem.blocks):
        like = covariance.like_of(block, model.noise)
        if like not in known:
            size = float(covariance.level[block] * model.noise.scale[block]) ** 2
            slow_covariance = covariance.of_dwells(block, model.noise, dwells) / size
            slow_covariance -= np.diag((model.problem.error[block] / covariance.level[block]) ** 2)
            known[like] = np.maximum(np.einsum("ij,ij->i", projector @ slow_covariance, projector), 0.0)
        slow[block] = known[like]
    return slow


def _log_squares(ratio: Array, classes: Places, filled: list[int]) -> Array:
    """Log mean squares (blocks, k) of the ratios (blocks, n) in each of k classes of force."""
    inner = [inner_mean(np.where(classes == k, np.sqrt(ratio), np.nan)) for k in filled]
    return np.log(np.maximum(np.stack(inner, axis=1), 1e-300))


def _expected_log_squares(
    model: Model, projector: Array, judged: tuple[Places, ...], classes: Places, filled: list[int]
) -> Array:
    """What :func:`_log_squares` is on average of the model's noise: the mean log of few values is below that of many."""
    covariance, dwells = model.problem.covariance, np.arange(model.problem.n)
    blocks, seen = judged[0][:, 0], judged[1][0]
    alike: dict[tuple[object, ...], list[int]] = {}
    for k, block in enumerate(blocks):
        alike.setdefault((covariance.like_of(block, model.noise), classes[k].tobytes()), []).append(k)
    expected = np.empty((len(blocks), len(filled)))
    for members in alike.values():
        first = blocks[members[0]]
        root = (projector @ np.linalg.cholesky(covariance.of_dwells(first, model.noise, dwells)))[seen]
        drawn = np.random.default_rng(first).standard_normal((_DRAWS * len(members), dwells.size)) @ root.T
        sizes = _log_squares(drawn**2 / np.sum(root**2, axis=1), classes[members[0]], filled)
        expected[members] = sizes.mean(axis=0)
    return expected


def _clipping_limits(ratio: Array, along: Array) -> Array:
    """Clipping limits (blocks, n) of the squared residuals ``ratio`` (blocks, n), from the median of their class of force."""
    classes = np.digitize(along, _EDGES)
    middle = np.array(
        [np.median(ratio[classes == k]) if np.any(classes == k) else np.inf for k in range(len(_EDGES) + 1)]
    )
    return _FAR * middle[classes] / NORMAL_MEDIAN**2


def _variance_at(along: Array, ratio: Array, at: Array) -> Array:
    """Variance at the forces ``at`` along the axis: a nonnegative quadratic in the squared force, fitted to ``ratio``."""
    basis, fitted, sizes = _bernstein(along.ravel()), np.ones(along.size), np.ones(3)
    for _ in range(_ROUNDS):  # reweighted, because a square scatters in proportion to its mean
        sizes = _nonnegative(basis / fitted[:, None], ratio.ravel() / fitted)
        fitted = np.maximum(basis @ sizes, _LEAST)
    return np.maximum(_bernstein(at) @ sizes, _LEAST)


def _nonnegative(columns: Array, target: Array) -> Array:
    """Nonnegative least-squares coefficients (p,) of a few columns (m, p), by trying every subset."""
    gram, along = columns.T @ columns, columns.T @ target
    best, most = np.zeros(len(along)), 0.0
    for size in range(1, len(along) + 1):
        for held in map(list, combinations(range(len(along)), size)):
            found = np.linalg.lstsq(gram[np.ix_(held, held)], along[held], rcond=None)[0]
            if found.min() >= 0.0 and float(found @ along[held]) > most:
                best, most = np.zeros(len(along)), float(found @ along[held])
                best[held] = found
    return best


def _bernstein(along: Array) -> Array:
    """Bernstein polynomials of second degree, (..., 3), in the square of a normalised force."""
    u = along**2
    return np.stack([(1.0 - u) ** 2, 2.0 * u * (1.0 - u), u**2], axis=-1)
