"""When enough is known: how a decision during a run allows for a noise that the same dwells show, and the length of a dwell.

A run that ends as soon as its uncertainty is small enough ends more often where the noise is estimated too small. With ν degrees
of freedom the estimated variance over the true one is χ²/ν, so the true standard deviation exceeds the estimated one times
√(ν/χ²_q) with probability q. With q = 5 % over the number of looks it is missed at any of them with at most 5 % (Bonferroni):
what is asked for is compared with the estimated uncertainty times this factor. For the same reason a coverage factor k of one
decision becomes that of as many decisions as there are looks, Φ(−k′) = Φ(−k)/looks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.distributions import chi2_quantile, normal_tail, normal_upper
from inertial.noise.flicker import SLOWEST_FITTED, flicker_kernel

MISSED = 0.05
"""Probability that the noise is larger than the guard allows at any look: that of the interval that U states."""

GROWTH = 1.15
"""Dwells at a look over those at the look before: the errors fall by 7 % between two, and a plan has about ten of them."""

LOSS = 1.1
"""Variance that a shorter dwell may have over that of the planned one: the errors of the whole plan grow by at most 5 %."""


def looks_at(first: int, last: int) -> list[int]:
    """Numbers of dwells at which a run looks, from the first at which it could end to before the last."""
    counts: list[int] = []
    count = float(first)
    while count < last:
        counts.append(int(count))
        count = max(count * GROWTH, count + 1.0)
    return counts


def noise_guard(dof: int, looks: int) -> float:
    """Factor of a standard deviation of ``dof`` degrees of freedom that the true one exceeds at any look with at most 5 %."""
    return float(np.sqrt(dof / chi2_quantile(MISSED / looks, dof)))


def over_looks(coverage_factor: float, looks: int) -> float:
    """Coverage factor with which any of several decisions is wrong as seldom as a single one is with the given factor."""
    return float(normal_upper(normal_tail(coverage_factor) / looks))


def largest_ratio(errors: Array, effects: Sequence[str], asked: dict[str, float]) -> Array:
    """Largest error over what is asked for, (units,), of errors (units, m, p) by the effect of their columns; zero for none."""
    columns = [(k, asked[effect]) for k, effect in enumerate(effects) if effect in asked]
    if not columns:
        return np.zeros(len(errors))
    index, limit = zip(*columns, strict=True)
    return np.max(errors[..., list(index)] / np.array(limit), axis=(-2, -1))


@dataclass(frozen=True)
class DwellNoise:
    """Noise of a dwell of ``length`` s, standard deviations in one unit, and the ``spacing`` from one to the next, s."""

    white: float
    flicker: float
    length: float
    spacing: float

    def variance(self, lengths: Array) -> Array:
        """What dwells of some lengths, s, tell apart: the white part, and the slow part that changes from one to the next."""
        kernel = flicker_kernel(self.spacing * np.arange(3.0), slowest=SLOWEST_FITTED)
        return self.white**2 * self.length / lengths + self.flicker**2 * float(kernel[0, 0] - kernel[0, 1])


def chosen_length(noise: DwellNoise, planned: float, lengths: Array, *, enough: bool) -> float:
    """The length of the next dwells, of some lengths in s.

    Where the dwells that are left are ``enough``, the shortest whose variance is at most :data:`LOSS` times that of the planned
    length: a longer mean is no better known, since the output wanders. Where they are not, the one, not below the planned
    length, with the least variance times station time.
    """
    variance = noise.variance(lengths)
    if enough:
        allowed = LOSS * float(noise.variance(np.array([planned]))[0])
        return float(np.min(lengths[variance <= allowed], initial=planned))
    cost = np.where(lengths >= planned, variance * (lengths + noise.spacing - noise.length), np.inf)
    return float(lengths[int(np.argmin(cost))]) if np.isfinite(cost).any() else planned
