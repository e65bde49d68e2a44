"""Tails of the noise: the limit for bad dwells where large deviations are frequent.

The noise of a dwell is modelled as a normal part plus a Student t part of three degrees of freedom with an unknown share of the
variance; few noises have heavier tails. The prior density of the share is flat: small shares, which no number of dwells excludes,
then count little in a lot whose dwells show no tails. The posterior uses the likelihood of the other dwells' deletion residuals,
truncated at the smallest value that was left out, and so holds whether or not the dwells left out belong to the tail.
Whitened residuals cannot be used, because whitening spreads the error of one dwell over the dwells after it.

A dwell counts as tail of the noise where such noise gives as large a deviation in any dwell of the run with more than a stated
probability. The size of a deviation is judged by its length and by the product of the probabilities of its axes: noise that is
independent on three axes is seldom large on two of them at once.

Whether the tails of a lot are heavy is judged by the kurtosis of its residuals (Anscombe & Glynn, Biometrika 70 (1983) 227).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from inertial.arrays import Array
from inertial.data_errors.bad_dwells import deletion_residuals
from inertial.data_errors.removed_dwells import BadDwell
from inertial.decisions import HEAVY, TAILS, TAILS_REACH
from inertial.distributions import chi2_tail, kurtosis_tail, normal_tail, student_tail
from inertial.estimation.model import Model

_SHARES = (0.0, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0)
"""Shares of the variance that heavy tails may have."""

_WEIGHTS = np.array(_SHARES) / sum(_SHARES)
"""Their probabilities where there are heavy tails: a flat density of the share."""

_DOF = 3.0
"""Degrees of freedom of the heavy part: P(|x| > z) falls off as z⁻³."""

_SCALES = np.geomspace(0.7, 1.3, 25)
"""Standard deviations of the noise over the RMS of the dwells that were not left out."""

_FURTHEST, _STEP = 60.0, 0.02
"""Range and step of the tables, standard deviations."""

_TAIL = 8.0
"""Standard deviations beyond which only the heavy part counts."""

_FEWEST = 60
"""Smallest number of values for a test of their tails."""


def with_tails(model: Model, removed: Sequence[BadDwell]) -> list[BadDwell]:
    """The removed dwells, with ``tail`` set where the tails of the other dwells' noise explain the deviation.

    Parameters
    ----------
    model : the model without these dwells
    """
    values = np.abs(deletion_residuals(model))
    if not removed or values.size < _FEWEST:
        return list(removed)
    noise = _Noise.of(values, min(d.deviations for d in removed))
    dwells = values.size / len(removed[0].by_axis)
    return [replace(d, tail=noise.reaches(d.by_axis, dwells) >= TAILS_REACH) for d in removed]


def heavy(values: Array) -> bool:
    """Whether values (m,) have heavier tails than a normal distribution."""
    return values.size >= _FEWEST and kurtosis_tail(values) < HEAVY


@dataclass(frozen=True)
class _Noise:
    """Joint posterior of the share of heavy tails and of the scale of a noise.

    weight : (shares, scales), probabilities; scale : (scales,), standard deviations
    """

    weight: Array
    scale: Array

    @staticmethod
    def of(values: Array, below: float) -> "_Noise":
        """The posterior, given absolute values (m,) of which only those smaller than ``below`` are known to be noise."""
        inside = values[values < below]
        scale = _SCALES * float(np.sqrt(np.mean(inside**2)))
        log = np.empty((len(_SHARES), scale.size))
        for k in range(len(_SHARES)):
            grid, density, _ = _table(k)
            for j, s in enumerate(scale.tolist()):
                below_limit = 1.0 - float(_probability_beyond(k, np.array([below / s]))[0])
                each = np.log(np.maximum(np.interp(inside / s, grid, density), 1e-300))
                log[k, j] = float(each.sum()) - inside.size * np.log(s * max(below_limit, 1e-12))
        prior = np.where(_WEIGHTS > 0.0, TAILS * _WEIGHTS, 1.0 - TAILS)
        weight = np.exp(log - log.max()) * prior[:, None]
        return _Noise(weight / weight.sum(), scale)

    def reaches(self, by_axis: Array, dwells: float) -> float:
        """Probability that one of ``dwells`` dwells deviates as much as ``by_axis`` (axes,), standard deviations."""
        length, axes = float(np.linalg.norm(by_axis)), len(by_axis)
        total = 0.0
        for k in range(len(_SHARES)):
            single_axis = axes * _probability_beyond(k, length / self.scale)
            each = np.stack([_probability_beyond(k, abs(float(v)) / self.scale) for v in by_axis])
            together = chi2_tail(-2.0 * np.log(np.maximum(each, 1e-300)).sum(axis=0), 2.0 * axes)
            least = np.minimum(2.0 * dwells * np.minimum(single_axis, together), 1.0)
            total += float(np.sum(self.weight[k] * least))
        return total


def _probability_beyond(index: int, z: Array) -> Array:
    """P(|x| > z) of a value of variance one; ``index``: index of its share of heavy tails in ``_SHARES``."""
    share = _SHARES[index]
    if share == 0.0:
        return 2.0 * normal_tail(z)
    grid, _, distribution = _table(index)
    near = 2.0 * (1.0 - np.interp(z, grid, distribution))
    return np.where(z < _TAIL, near, 2.0 * student_tail(z / np.sqrt(share / _DOF), _DOF))


@cache
def _table(index: int) -> tuple[Array, Array, Array]:
    """Grid from zero on, density and distribution function of a normal plus a heavy-tailed part of total variance one."""
    share, half = _SHARES[index], round(_FURTHEST / _STEP)
    grid = _STEP * np.arange(-half, half + 1)
    edges = np.append(grid - 0.5 * _STEP, grid[-1] + 0.5 * _STEP)
    mass = np.diff(normal_tail(-edges / max(np.sqrt(1.0 - share), 1e-9)))
    if share > 0.0:
        tails = np.diff(student_tail(-edges / np.sqrt(share / _DOF), _DOF))
        size = 4 * grid.size
        both = np.fft.irfft(np.fft.rfft(mass, size) * np.fft.rfft(tails, size), size)
        mass = np.maximum(both[half : half + grid.size], 1e-300)
    upper = mass[half + 1 :]
    # distribution up to the middle of each cell
    distribution = 0.5 + 0.5 * mass[half] + np.concatenate([[0.0], np.cumsum(upper)]) - 0.5 * mass[half:]
    density = np.asarray(mass[half:] / _STEP, dtype=np.float64)
    return np.asarray(grid[half:], dtype=np.float64), density, np.minimum(distribution, 1.0)
