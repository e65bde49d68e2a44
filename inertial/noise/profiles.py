"""Which terms an Allan curve needs, and between which values each may lie, in units of one sample."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple, cast

import numpy as np
from scipy.optimize import brentq

from inertial.arrays import Array, Flags
from inertial.distributions import chi2_quantile
from inertial.noise import mixture
from inertial.noise.covariance import Sums
from inertial.noise.mixture import MixtureFit

_KEPT_AT = 6.635
"""Chi-square (1 % for one term) that a term must be worth to be called identified."""
_RAMP_KEPT_AT = 10.83
"""The same (0.1 %) for the ramp, which nothing but the last points of a curve tells from a walk: with so few independent
differences the logarithm of a variance is far from normal. Of 216 records of white noise and walk 7 passed 6.6, and 0 this."""
_ONE_SIDED_95 = 2.706
_NEGLIGIBLE = 1e-6
"""Share of the curve, as a variance, below which a term makes no difference."""
_WIDEST = 40.0  # natural logarithm: how far above a strength its upper limit is looked for
_RESOLUTION = 2e-3  # of an end of an interval, relative
_STEP = 0.7  # of the natural logarithm, on the way to a lower end
_ROUGH = 0.02  # the resolution where each look takes the covariance anew


class TermFit(NamedTuple):
    """Strengths of one curve, NaN where not identified; ends of the intervals; the mixture that runs through the points."""

    value: Array
    low: Array
    high: Array
    mixture: Array
    chi2: float
    dof: float


def fit_terms(variance: Array, moments: Sums, threshold: float, only: str = "") -> TermFit:
    """Terms of one curve (t,), each identified only if its interval, with all other terms free, does not reach zero.

    Parameters
    ----------
    threshold : chi-square at the ends of the two-sided intervals
    only : the term that has ends, where they are asked of one alone
    """
    curve = _Curve(variance, moments)
    n, k, r = (mixture.TERMS.index(symbol) for symbol in "NKR")
    bars = np.where(np.arange(len(mixture.TERMS)) == r, _RAMP_KEPT_AT, _KEPT_AT)
    allowed = np.ones(len(mixture.TERMS), dtype=np.bool_)
    start = mixture.first_guess(variance, moments)
    while True:
        task, strengths, best = mixture.settled(variance, moments, allowed, np.where(allowed, start, 0.0))
        used, reduced, cost = _needed(task, strengths, best, allowed)
        worth = {j: curve.worth(j) / bars[j] for j in np.flatnonzero(used).tolist() if j != n} if used.sum() > 1 else {}
        doubtful = [j for j in worth if not worth[j] > 1.0]
        if not doubtful:
            break
        allowed[min(doubtful, key=lambda j: worth[j])] = False
    task, strengths, best = mixture.settled(variance, moments, np.ones_like(used), np.where(used, reduced, 0.0))
    low, high = np.zeros(used.size), np.zeros(used.size)
    for j in [mixture.TERMS.index(only)] if only else range(used.size):
        if used[j]:
            low[j], high[j] = _profile(task, strengths, best, j, threshold)
            low[j] = low[j] if low[j] > 0.0 else curve.low_end(j, float(reduced[j]), threshold)
        else:
            high[j] = _profile(task, strengths, best, j, _ONE_SIDED_95)[1]
    if not used[k] and only in {"", "K"}:
        high[k] = max(high[k], _walk_limit(variance, moments, np.where(used, reduced, 0.0)))
    value = np.where(used, reduced, np.nan)
    low = np.fmin(low, np.where(used, reduced, 0.0))
    dof = float(variance.size - int(used.sum()))
    return TermFit(value, low, np.fmax(high, np.nan_to_num(value)), curve.strengths, cost, dof)


def _walk_limit(variance: Array, moments: Sums, fitted: Array) -> float:
    """Upper limit (95 %, one-sided) of the strength of a walk: that of a curve which is walk alone at one averaging time.

    That is χ² with the degrees of freedom of a walk, few at long times; the profile takes the logarithm of such a variance for
    normal, and its limit held the truth in 45 to 85 %. The time is the one that the fitted mixture, and not the very point, would
    give the lowest limit at.
    """
    model = mixture.basis(moments.m)
    k = mixture.TERMS.index("K")
    alone = np.where(np.arange(model.shape[1]) == k, 1.0, 0.0)
    spread = np.diagonal(moments.covariance(alone[:4], alone[4]))
    edf = np.maximum(2.0 * model[:, k] ** 2 / spread, 1.0)
    rise = edf / chi2_quantile(0.05, edf) / model[:, k]
    lowest = int(np.argmin((model @ fitted) * rise))
    return float(variance[lowest] * rise[lowest])


class _Curve:
    """The likelihood of one curve with the covariance taken anew for every mixture that is tried."""

    def __init__(self, variance: Array, moments: Sums) -> None:
        self.variance, self.moments = variance, moments
        self._worth: dict[int, float] = {}
        ceiling = np.log(variance)[:, None] - np.log(mixture.basis(moments.m))
        self._ceiling = np.exp(np.min(ceiling, axis=0))
        everything = np.ones(len(mixture.TERMS), dtype=np.bool_)
        first = mixture.first_guess(variance, moments)
        seeds = [first, *(np.where(np.arange(first.size) == k, 0.0, first) for k in (2, 3, 4) if first[k] > 0.0)]
        tried = [mixture.deviance(variance, moments, everything, self._seeded(seed)) for seed in seeds]
        self.best, self.strengths = min(tried, key=lambda fit: fit[0])

    def _seeded(self, start: Array) -> Array:
        return start if np.any(start > 0.0) else 0.3 * self._ceiling

    def at(self, j: int, strength: float) -> float:
        """Deviance over the best with term j held at a strength, all others free; the others may come in for it."""
        free = np.ones(self.strengths.size, dtype=np.bool_)
        free[j] = False
        starts = [self.strengths.copy()]
        starts += [np.where(np.arange(free.size) == k, self._ceiling, self.strengths) for k in (2, 3, 4) if k != j]
        for start in starts:
            start[j] = strength
        tried = (mixture.deviance(self.variance, self.moments, free, self._seeded(start))[0] for start in starts)
        return min(tried) - self.best

    def worth(self, j: int) -> float:
        """Chi-square that the curve is worse without term j; computed once, whichever other terms are allowed meanwhile."""
        if j not in self._worth:
            self._worth[j] = self.at(j, 0.0)
        return self._worth[j]

    def low_end(self, j: int, start: float, threshold: float) -> float:
        """Strength below ``start`` at which the deviance has risen by ``threshold``, for a term that is worth more than that."""

        @cache
        def excess(log_strength: float) -> float:
            return min(self.at(j, float(np.exp(log_strength))) - threshold, 1e6)

        inside = float(np.log(start))
        outside = inside - _STEP
        while excess(outside) < 0.0 and start * _NEGLIGIBLE < np.exp(outside):
            inside, outside = outside, outside - _STEP
        return _crossing(excess, outside, inside, _ROUGH)


def _needed(task: MixtureFit, strengths: Array, best: float, allowed: Flags) -> tuple[Flags, Array, float]:
    """Terms that stay after dropping, one by one, the one whose loss costs least, while that is little."""
    used = (strengths > 0.0) & allowed
    current, cost = np.where(used, strengths, 0.0), best
    while used.sum() > 1:
        trials: list[tuple[float, int, Array]] = []
        for j in np.flatnonzero(used).tolist():
            fewer = used.copy()
            fewer[j] = False
            start = np.where(fewer, np.maximum(current, 1e-9 * current.max()), 0.0)
            fitted, worse = task.solve(fewer, start)
            trials.append((worse, j, fitted))
        worse, j, fitted = min(trials, key=lambda trial: trial[0])
        if worse - cost > _KEPT_AT:
            break
        used[j], current, cost = False, fitted, worse
    return used, current, cost


def _profile(task: MixtureFit, strengths: Array, best: float, j: int, threshold: float) -> tuple[float, float]:
    """Strengths of term j, below and above, at which chi-square has risen by `threshold`, all others free."""
    free = np.ones(strengths.size, dtype=np.bool_)
    free[j] = False
    whole_curve = float(np.exp(np.min(task.target - np.log(task.model[:, j]))))

    @cache
    def excess(log_strength: float) -> float:
        start = strengths.copy()
        start[j] = np.exp(log_strength)
        return min(task.solve(free, start)[1] - best - threshold, 1e6)

    centre = float(np.log(max(strengths[j], _NEGLIGIBLE * whole_curve)))
    inside, outside = centre, centre + 0.5
    while excess(outside) < 0.0 and outside < centre + _WIDEST:
        inside, outside = outside, outside + 1.5
    high = _crossing(excess, inside, outside)
    bottom = centre + np.log(_NEGLIGIBLE)
    if strengths[j] <= 0.0 or excess(bottom) <= 0.0:
        return 0.0, high
    return _crossing(excess, bottom, centre), high


def _crossing(excess: Callable[[float], float], a: float, b: float, resolution: float = _RESOLUTION) -> float:
    """Strength where `excess` of its logarithm changes sign; the nearer end where it does not.

    `excess` keeps its values: each end is asked for again by the search.
    """
    at_a, at_b = excess(a), excess(b)
    if at_a * at_b > 0.0:
        return float(np.exp(a if abs(at_a) < abs(at_b) else b))
    return float(np.exp(cast("float", brentq(excess, a, b, xtol=resolution))))
