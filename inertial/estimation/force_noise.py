"""Noise of a dwell that depends on the force along the axis: of a reference voltage, of a floor that tilts the table.

A lot's covariance has one white variance for every unit and axis. Where it grows with the force, the residuals of the poses along
gravity look like a curve of the transfer function. The dependence is estimated before any effect is searched, from poses that
were measured several times: a mean of each pose takes up what repeats with the pose, whatever its curve, and what all units do
together at a dwell is taken off. Without repeated poses nothing can be told.
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
"""Dwells of an axis between two edges from which on they have a scatter."""

_LEFT = 0.25
"""Share of the dwells that poses and soaks must leave as degrees of freedom."""

_FAR = 9.0
"""Square over that of its class beyond which a dwell is bad, and counts as this."""

_LEAST = 0.03
"""Part of the white variance of an axis that a dwell has at the least."""

_ROUNDS = 5


def by_force(model: Model, soak: Places | None = None) -> Array | None:
    """Standard deviation of the white noise of each dwell over its axis', (units, n, axes); None where force makes no difference.

    Parameters
    ----------
    soak : (n,), number of the soak of each dwell, where the temperatures of the model are not those that tell it
    """
    problem, covariance = model.problem, model.problem.covariance
    units, n = problem.lot.state.time.shape
    if problem.lot.radial or n > LONGEST:
        return None
    soak = soaks(problem.lot.state) if soak is None else soak
    force = np.broadcast_to(problem.lot.state.force, (units, n, 3))
    q = _taken_up(force[0], np.broadcast_to(problem.lot.state.time, (units, n))[0], soak)
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
    along = along / float(along.max())
    scale = (covariance.level * model.noise.scale)[:, None] ** 2
    alone = (problem.error / covariance.level[:, None]) ** 2 * scale
    projector = np.eye(n) - q @ q.T
    slow = _slow_left(model, projector) * scale
    alone[~complete_blocks] = alone[complete_blocks].mean()
    sizes = _by_class((left**2 / (alone @ projector**2 + slow))[complete_blocks], along[complete_blocks])
    if sizes is None or not differ(sizes):
        return None
    variance = np.ones_like(left)
    for _ in range(_ROUNDS):  # each dwell's residual holds noise of the others
        white = (alone * variance) @ projector**2
        ratio = (left**2 / (white + slow))[complete_blocks]
        ratio /= ratio.mean(axis=1, keepdims=True)
        curve = _curve(along[complete_blocks], np.minimum(ratio, _capped(ratio, along[complete_blocks])), along)
        variance *= np.maximum((curve * (white + slow) - slow) / white, _LEAST)
        variance = np.maximum(variance / np.mean(variance, axis=1, keepdims=True), _LEAST)
    return np.swapaxes(np.sqrt(variance).reshape(units, problem.per_unit, n), 1, 2)


def _taken_up(force: Array, time: Array, soak: Places) -> Array | None:
    """Orthonormal columns (n, p) of each pose, and of bias, drift and response of each soak; None where they leave too little."""
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


def _slow_left(model: Model, projector: Array) -> Array:
    """Variance (blocks, n) that a projector (n, n) leaves of the slow noise of a model, over the variance of each block."""
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


def _by_class(ratio: Array, along: Array) -> Array | None:
    """Logarithms (blocks, classes) of the mean square of each class of force; None where there is but one class."""
    classes = np.digitize(along, _EDGES)
    filled = [k for k in range(len(_EDGES) + 1) if np.all(np.sum(classes == k, axis=1) >= _FEWEST)]
    if len(filled) < 2 or len(ratio) < 2:
        return None
    inner = np.stack([inner_mean(np.where(classes == k, np.sqrt(ratio), np.nan)) for k in filled], axis=1)
    return np.log(np.maximum(inner, 1e-300))


def _capped(ratio: Array, along: Array) -> Array:
    """Squares (blocks, n) over the mean of their block beyond which a dwell is bad."""
    classes = np.digitize(along, _EDGES)
    middle = np.array(
        [np.median(ratio[classes == k]) if np.any(classes == k) else np.inf for k in range(len(_EDGES) + 1)]
    )
    return _FAR * middle[classes] / NORMAL_MEDIAN**2


def _curve(along: Array, ratio: Array, at: Array) -> Array:
    """Variance at forces along the axis: a quadratic in their square, nowhere negative, by least squares."""
    basis, fitted, sizes = _quadratic(along.ravel()), np.ones(along.size), np.ones(3)
    for _ in range(_ROUNDS):  # the scatter of a square is its mean
        sizes = _nonnegative(basis / fitted[:, None], ratio.ravel() / fitted)
        fitted = np.maximum(basis @ sizes, _LEAST)
    return np.maximum(_quadratic(at) @ sizes, _LEAST)


def _nonnegative(columns: Array, target: Array) -> Array:
    """Least-squares sizes (p,) of a few columns, none of them negative: the best of all subsets that have none."""
    gram, along = columns.T @ columns, columns.T @ target
    best, most = np.zeros(len(along)), 0.0
    for size in range(1, len(along) + 1):
        for held in map(list, combinations(range(len(along)), size)):
            found = np.linalg.lstsq(gram[np.ix_(held, held)], along[held], rcond=None)[0]
            if found.min() >= 0.0 and float(found @ along[held]) > most:
                best, most = np.zeros(len(along)), float(found @ along[held])
                best[held] = found
    return best


def _quadratic(along: Array) -> Array:
    """Bernstein's polynomials (..., 3) of the square of a force."""
    u = along**2
    return np.stack([(1.0 - u) ** 2, 2.0 * u * (1.0 - u), u**2], axis=-1)
