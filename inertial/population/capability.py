"""Capability of a population against limits, with confidence intervals."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, norm

from inertial.arrays import Array
from inertial.arrays import Index as Codes

CONFIDENCE = 0.95
HALF_NORMAL, PRIOR_VALUES = (0.9953, 3.8692), 30.0
"""Skewness and kurtosis of a half-normal, and the values that they are worth beside those of a sample."""


@dataclass(frozen=True)
class Index:
    """A capability index with its two-sided 95 % interval."""

    value: float
    low: float
    high: float


def cpk(
    mean: float,
    sigma: float,
    low: float,
    high: float,
    n: float,
    dof: float | None = None,
    shape: tuple[float, float] = (0.0, 3.0),
) -> Index:
    """Distance of the nearer limit in units of 3σ, with Bissell's interval (Montgomery, eq. 8.21).

    It is Cpk where σ is that inside the lots and Ppk where it is that of all values (AIAG SPC, 2nd ed.). A limit may be
    infinite: then the other one counts alone.

    Parameters
    ----------
    n, dof : independent values behind the mean, and degrees of freedom of σ, n − 1 where None
    shape : skewness and kurtosis of the values, (0, 3) of normal ones. Of folded values σ is less known than Bissell's interval
        says, and large where the mean is large: it held in 86 %
    """
    value = min(high - mean, mean - low) / (3.0 * sigma)
    side = 1.0 if high - mean <= mean - low else -1.0
    skew, kurtosis = shape
    of_sigma = value**2 * (kurtosis - 1.0) / (4.0 * (n - 1 if dof is None else dof))
    error = float(np.sqrt(max(1.0 / (9.0 * n) + of_sigma + side * value * skew / (3.0 * n), 0.0)))
    reach = float(norm.isf(0.5 * (1.0 - CONFIDENCE))) * error
    return Index(value, value - reach, value + reach)


def shape_of(values: Array) -> tuple[float, float]:
    """Skewness and kurtosis of magnitudes (n,), drawn towards those of a half-normal by as much as some values would be worth.

    Few values show too small moments: with those of 20 half-normal values alone the interval of Ppk holds in 88 %.
    """
    n = float(values.size)
    left = values - values.mean()
    second = float(np.mean(left**2))
    skew, kurtosis = float(np.mean(left**3)) / second**1.5, float(np.mean(left**4)) / second**2
    skew *= np.sqrt(n * (n - 1.0)) / (n - 2.0)
    kurtosis = 3.0 + (n - 1.0) / ((n - 2.0) * (n - 3.0)) * ((n + 1.0) * (kurtosis - 3.0) + 6.0)
    skew, kurtosis = (
        (n * sample + PRIOR_VALUES * prior) / (n + PRIOR_VALUES)
        for sample, prior in zip((skew, kurtosis), HALF_NORMAL, strict=True)
    )
    return float(skew), float(max(kurtosis, 1.0 + skew**2))


def sigma_within(values: Array, groups: Codes) -> tuple[float, int]:
    """Pooled standard deviation inside groups, and its degrees of freedom.

    Parameters
    ----------
    values : (n,); groups : (n,), number of the group, from 0.
    """
    counts = np.bincount(groups)
    means = np.bincount(groups, values) / np.maximum(counts, 1)
    dof = int(values.size - np.count_nonzero(counts))
    return (float(np.sqrt(np.sum((values - means[groups]) ** 2) / dof)) if dof > 0 else float("nan")), dof


def independent(values: Array, groups: Codes) -> tuple[float, float]:
    """How many independent values the mean of values that come in groups is worth, and the degrees of freedom of their σ.

    Groups differ by a variance of their own (one-way ANOVA); the degrees of freedom are those of Satterthwaite (1946).
    """
    counts = np.bincount(groups)
    counts = counts[counts > 0].astype(float)
    n, k = float(values.size), float(counts.size)
    inside, dof = sigma_within(values, groups)
    if k < 2 or dof < 1:
        return n, n - 1.0
    total = float(np.sum((values - values.mean()) ** 2))
    within = inside**2
    between = max(0.0, ((total - dof * within) / (k - 1.0) - within) / ((n - np.sum(counts**2) / n) / (k - 1.0)))
    worth = (between + within) / (between * float(np.sum(counts**2)) / n**2 + within / n)
    return worth, (between + within) ** 2 / (between**2 / (k - 1.0) + within**2 / dof)


def fraction_interval(count: int, total: int) -> Index:
    """Share of a count with the exact interval of Clopper and Pearson (e-Handbook 7.2.4.1)."""
    interval = binomtest(count, total).proportion_ci(CONFIDENCE, "exact")
    return Index(count / total, float(interval.low), float(interval.high))
