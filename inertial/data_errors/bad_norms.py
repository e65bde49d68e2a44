"""Bad dwells where only the norm of gravity is known: one or two at a time, with the noise estimated again without them.

With few dwells and many coefficients two bad dwells mask each other, and either looks like wander. Pairs are therefore deleted
together, and every suspected set B is judged at the noise of the other dwells: with P = V⁻¹ − V⁻¹H(HᵀV⁻¹H)⁻¹HᵀV⁻¹ its deletion
residuals are (P_BB)⁻¹(Py)_B, and (Py)_Bᵀ(P_BB)⁻¹(Py)_B/|B| over the variance is F with |B| and ν − |B| degrees of freedom.
"""

import numpy as np
from scipy.special import gammaln

from inertial.arrays import Array
from inertial.data_errors.removed_dwells import BadDwell, model_without
from inertial.distributions import chi2_quantile
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise
from inertial.probability import log_f_tail

FEWEST_DOF = 8
"""Degrees of freedom below which no dwell can be identified as bad."""

MOST = 0.1
"""Largest share of a unit's dwells that is left out; two are always allowed."""

BAD_NORM = 0.005
"""Probability, over all dwells of a recording, below which a dwell counts as bad."""

SECOND = 0.05
"""Probability, over the dwells of a recording, that each dwell of a pair must fall below beside the other.

With one half instead, a sound dwell was named beside a single bad one of 5 to 8 standard deviations in a quarter of recordings.
"""

RECORDED_DOF = 30
"""Degrees of freedom that the recorded noise of the samples counts for, where the residuals of the dwells agree with it."""

AGREES = 0.05
"""Probability of the residual variance, two-sided, below which the residuals disagree with the recorded noise."""

_TRIED = 3  # suspected sets of each size and noise for which the noise is estimated again
_LONG = 220  # largest number of dwells for the test of pairs: they mask each other in short records only
_HANGING = 1e-6  # relative P_ii below which a dwell alone determines a coefficient


def bad_norms(model: Model) -> list[BadDwell]:
    """The dwells that disagree with a model and its noise, the most certain first."""
    bad: list[BadDwell] = []
    most = max(2, int(MOST * model.problem.n))
    while True:
        judged = [_judged(model, unit, dwells) for unit, dwells in _suspected_sets(model)]
        certain = [(log_p, dwells) for log_p, dwells in judged if log_p < np.log(BAD_NORM)]
        certain = [(log_p, dwells) for log_p, dwells in certain if len(bad) + len(dwells) <= most]
        if not certain:
            return bad
        # prefer the smaller of nested sets, unless the larger is far more significant
        _, best = min(certain, key=lambda each: each[0] + 4.0 * len(each[1]))
        bad += best
        model = model_without(model, [d.index for d in best])


def _suspected_sets(model: Model) -> list[tuple[int, tuple[int, ...]]]:
    """Suspected sets (unit, one or two dwells): outliers at the fitted noise or at white noise."""
    if model.space.dof < FEWEST_DOF:
        return []
    chosen: dict[tuple[int, tuple[int, ...]], None] = {}
    for noise in dict.fromkeys([model.noise.shares, model.problem.covariance.white_noise().shares]):
        space = model.at(Noise(noise, model.noise.scale, model.noise.prior))
        for unit in range(model.problem.lot.state.time.shape[0]):
            p, py = _projector(model, Noise(noise, model.noise.scale, model.noise.prior), unit)
            for size, drop, dwells in _drops(p, py):
                left = np.maximum(space.rss - drop, 1e-300) / max(space.dof - size, 1)
                log_p = log_f_tail(drop / size / left, size, max(space.dof - size, 1))
                order = np.argsort(log_p)[:_TRIED]
                for k in order.tolist():
                    if log_p[k] + _looks(model, size) < 0.0:
                        chosen[unit, dwells[k]] = None
    return list(chosen)


def _looks(model: Model, size: int) -> float:
    """Logarithm of the number of sets of ``size`` dwells of one unit, over all units."""
    count = model.problem.covariance.count.astype(np.float64)
    sets = gammaln(count + 1) - gammaln(size + 1.0) - gammaln(np.maximum(count - size, 0) + 1)
    return float(np.logaddexp.reduce(sets))


def _projector(model: Model, noise: Noise, unit: int) -> tuple[Array, Array]:
    """P (n, n), 1/g², of a unit's block at a noise, and P·y (n,), 1/g."""
    space = model.at(noise)
    eye = space.covariance.whiten(np.eye(model.problem.n)[None], noise.shares, np.array([unit])) / noise.scale[unit]
    roots = space.project(eye, np.array([unit]))[0]
    return roots.T @ roots, roots.T @ space.residual[unit]


def _drops(p: Array, py: Array) -> list[tuple[int, Array, list[tuple[int, ...]]]]:
    """Reductions of the sum of squares by deleting single dwells, then the best pairs: (size, reductions, dwells) of each."""
    diagonal = np.diagonal(p)
    sound = np.flatnonzero(diagonal > _HANGING * max(float(diagonal.max()), 1e-300))
    singles = py[sound] ** 2 / diagonal[sound]
    drops: list[tuple[int, Array, list[tuple[int, ...]]]] = [(1, singles, [(int(k),) for k in sound])]
    if not 2 <= sound.size <= _LONG:
        return drops
    i, j = (sound[k] for k in np.triu_indices(sound.size, 1))
    area = diagonal[i] * diagonal[j] - p[i, j] ** 2
    fair = area > 1e-3 * diagonal[i] * diagonal[j]
    i, j, area = i[fair], j[fair], area[fair]
    pairs = (diagonal[j] * py[i] ** 2 - 2.0 * p[i, j] * py[i] * py[j] + diagonal[i] * py[j] ** 2) / area
    best = np.argsort(pairs)[::-1][: 4 * _TRIED]
    return [*drops, (2, pairs[best], [(int(i[k]), int(j[k])) for k in best])]


def _variance(rest: Model, unit: int) -> tuple[float, int]:
    """Variance of the whitened residuals of the other dwells, and its degrees of freedom.

    Fifteen degrees of freedom determine a variance to a third. Where the white noise is known from the samples and the residuals
    of the other dwells agree with it, it counts as further degrees of freedom.
    """
    variance, dof = max(rest.space.variance, 1e-300), rest.space.dof
    if not rest.problem.lot.recorded:
        return variance, dof
    scale = float(rest.noise.scale[unit]) ** 2
    low, high = chi2_quantile([0.5 * AGREES, 1.0 - 0.5 * AGREES], dof) / dof
    if not low < variance * scale < high:
        return variance, dof
    return (dof * variance + RECORDED_DOF / scale) / (dof + RECORDED_DOF), dof + RECORDED_DOF


def _judged(model: Model, unit: int, dwells: tuple[int, ...]) -> tuple[float, list[BadDwell]]:
    """Log probability, over all sets of that size, of dwells of a unit at the noise of the others, and these as bad dwells.

    Zero and none if the other dwells do not determine the model, or if one dwell of a pair is not bad beside the other.
    """
    rest = model_without(model, [(unit, dwell) for dwell in dwells])
    if rest.space.dof < FEWEST_DOF - len(dwells) or rest.space.local_rank < model.space.local_rank:
        return 0.0, []
    noise = model.problem.covariance.rescaled(rest.noise, rest.problem.covariance)
    p, py = _projector(model, noise, unit)
    projector = p[np.ix_(dwells, dwells)]
    off = np.linalg.solve(projector, py[list(dwells)])
    size = len(dwells)
    variance, dof = _variance(rest, unit)
    statistic = float(py[list(dwells)] @ off) / variance
    log_p = float(log_f_tail(statistic / size, size, dof)) + _looks(model, size)
    deviations = np.abs(off) / np.sqrt(np.diagonal(np.linalg.inv(projector)) * variance)
    if size > 1:
        # each dwell must be bad beside the other
        each = log_f_tail(deviations**2, 1, dof) + _looks(model, 1)
        if not bool(np.all(each < np.log(SECOND))):
            return 0.0, []
    pairs = zip(dwells, off, deviations, strict=True)
    return log_p, [BadDwell(unit, dwell, np.array([left]), np.array([deviation])) for dwell, left, deviation in pairs]
