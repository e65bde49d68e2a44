"""Groups compared, what stands out of a population, and the agreement of two results."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, median_abs_deviation, norm, rankdata, tiecorrect
from scipy.stats import f as f_distribution
from scipy.stats import t as student

from inertial.arrays import NORMAL_MEDIAN, Array, Index

COVERAGE = 2.0
MAD_EFFICIENCY = 0.37  # Rousseeuw and Croux 1993, J. Am. Stat. Assoc. 88, 1273


@dataclass(frozen=True)
class Comparison:
    """Groups of values compared: p-values of the F and the Kruskal–Wallis tests, and the share of variance between groups.

    ``effect`` is η² less what chance gives, ε² = (SSb − (k−1)·MSw)/SSt: zero where the groups do not differ.
    """

    groups: int
    n: int
    f_p: float
    rank_p: float
    effect: float


def compare(values: Array, groups: Index) -> Comparison | None:
    """Analysis of variance and its rank form (Kruskal and Wallis 1952, ties corrected); None with less than two groups.

    Parameters
    ----------
    values : (n,), finite; groups : (n,), number of the group, from 0.
    """
    counts = np.bincount(groups)
    k, n = int(np.count_nonzero(counts)), values.size
    if k < 2 or n <= k:
        return None
    total = float(np.sum((values - values.mean()) ** 2))
    if total == 0.0:
        return None
    within = float(np.sum((values - (np.bincount(groups, values) / np.maximum(counts, 1))[groups]) ** 2))
    ms_within = within / (n - k)
    f = (total - within) / (k - 1) / ms_within if ms_within > 0.0 else np.inf
    effect = max(0.0, (total - within - (k - 1) * ms_within) / total)
    return Comparison(k, n, float(f_distribution.sf(f, k - 1, n - k)), _rank_p(values, groups, counts, k), effect)


def _rank_p(values: Array, groups: Index, counts: Index, k: int) -> float:
    n, ranks = values.size, rankdata(values)
    sums = np.bincount(groups, ranks)
    used = counts > 0
    h = 12.0 / (n * (n + 1.0)) * float(np.sum(sums[used] ** 2 / counts[used])) - 3.0 * (n + 1.0)
    correction = tiecorrect(ranks)
    return float(chi2.sf(h / correction, k - 1)) if correction > 0.0 else 1.0


def holm(p_values: Array) -> Array:
    """p-values adjusted for their number, step by step (Holm 1979); (n,)."""
    # what could not be compared is no evidence, and spoils no other's
    p_values = np.where(np.isfinite(p_values), p_values, 1.0)
    order = np.argsort(p_values)
    n = p_values.size
    out = np.empty(n)
    out[order] = np.minimum(1.0, np.maximum.accumulate(p_values[order] * (n - np.arange(n))))
    return out


def sigma_of(values: Array) -> Array:
    """σ by the median absolute deviation along the first axis of values (n, …); NaN is left out."""
    return np.asarray(median_abs_deviation(values, axis=0, scale=NORMAL_MEDIAN, nan_policy="omit"))


def robust_z(values: Array) -> Array:
    """Distance of every value from the median, in σ by the median absolute deviation; (n, …) along the first axis."""
    spread = sigma_of(values)
    return (values - np.nanmedian(values, axis=0)) / np.where(spread > 0.0, spread, np.inf)


def unlike(values: Array, errors: Array) -> Array:
    """Distance of every value from the median, in σ of what the values themselves differ by and of their own errors; (n, p).

    Averages of many scatter less than those of few only by their errors: what lots differ by does not shrink with their size.
    """
    sigma2 = np.maximum(sigma_of(values) ** 2 - np.nanmedian(errors**2, axis=0), 0.0) + errors**2
    return (values - np.nanmedian(values, axis=0)) / np.sqrt(np.where(sigma2 > 0.0, sigma2, np.inf))


def outlier_limit(n: int, known_from: int | None = None, level: float = 0.01) -> float:
    """|z| that none of n normal values exceeds but with probability ``level``.

    Parameters
    ----------
    known_from : number of values that centre and σ come from by median and MAD; without end where None. σ is then known as from
        0.37 times as many values by their standard deviation, the efficiency of the MAD, and z is Student's
    """
    tail = 0.5 * level / max(n, 1)
    return float(norm.isf(tail) if known_from is None else student.isf(tail, max(MAD_EFFICIENCY * known_from, 1.0)))


def e_n(new: Array, old: Array, new_error: Array, old_error: Array, dof: Array | float = np.inf) -> Array:
    """The E_n number of two results: their difference over the root sum of squares of their expanded uncertainties.

    |E_n| ≤ 1 agrees (ISO/IEC 17043:2010, B.3.1.3; ISO 13528:2015, 9.7). Standard uncertainties are given. Their coverage factor
    is 2, or larger where they are known from few values: Student's for the same 95.45 % (JCGM 100, G.4).

    Parameters
    ----------
    dof : effective degrees of freedom of the combined uncertainty, infinite where it is known
    """
    coverage = np.where(np.isinf(dof), COVERAGE, student.isf(norm.sf(COVERAGE), np.maximum(dof, 1.0)))
    return (new - old) / (coverage * np.sqrt(new_error**2 + old_error**2))
