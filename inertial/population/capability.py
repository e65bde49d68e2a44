"""Capability of a population against limits, with confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binomtest, chi2, norm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Codes = NDArray[np.int64]

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Index:
    """A capability index with its two-sided 95 % interval."""

    value: float
    low: float
    high: float


def cp(sigma: float, width: float, n: int) -> Index:
    """(USL − LSL)/6σ with the χ² interval (Montgomery, eq. 8.20)."""
    value = width / (6.0 * sigma)
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = (float(np.sqrt(chi2.ppf(p, n - 1) / (n - 1))) for p in (tail, 1.0 - tail))
    return Index(value, value * low, value * high)


def cpk(mean: float, sigma: float, low: float, high: float, n: float, dof: float | None = None) -> Index:
    """Distance of the nearer limit in units of 3σ, with Bissell's interval (Montgomery, eq. 8.21).

    It is Cpk where σ is that inside the lots and Ppk where it is that of all values (AIAG SPC, 2nd ed.). A limit may be
    infinite: then the other one counts alone.

    Parameters
    ----------
    n, dof : independent values behind the mean, and degrees of freedom of σ, n − 1 where None
    """
    value = min(high - mean, mean - low) / (3.0 * sigma)
    error = float(np.sqrt(1.0 / (9.0 * n) + value**2 / (2.0 * (n - 1 if dof is None else dof))))
    reach = float(norm.isf(0.5 * (1.0 - CONFIDENCE))) * error
    return Index(value, value - reach, value + reach)


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
    own = inside**2
    between = max(0.0, ((total - dof * own) / (k - 1.0) - own) / ((n - np.sum(counts**2) / n) / (k - 1.0)))
    worth = (between + own) / (between * float(np.sum(counts**2)) / n**2 + own / n)
    return worth, (between + own) ** 2 / (between**2 / (k - 1.0) + own**2 / dof)


def fraction_interval(count: int, total: int) -> Index:
    """Share of a count with the exact interval of Clopper and Pearson (e-Handbook 7.2.4.1)."""
    interval = binomtest(count, total).proportion_ci(CONFIDENCE, "exact")
    return Index(count / total, float(interval.low), float(interval.high))
