"""Drift of units over the years: how a kind of device drifts, where each unit stands, and when it leaves its limits.

A parameter of a unit is taken as level + slope·t + random walk. The slopes of a kind have a mean and a spread, the walk a
variance that grows with time, and a calibration sees the level with its own uncertainty and that of mounting the unit
again. The kind's figures come from all its units; a unit's own history then moves its slope away from the kind's
as far as it tells something (a Kalman filter, which here is the best linear unbiased prediction).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import norm

from inertial.arrays import Array, Flags
from inertial.distributions import NORMAL_95

ROUNDS = 4
CLIP = 4.0  # pairs further out than so many σ tell of a unit, not of its kind
ODD = 3.0  # a unit whose own slope is so many σ from its kind's is no longer judged by its kind
LIKELY = 2.71  # χ² of one degree of freedom that nine in ten stay below: no worse an explanation
SURELY = 10.83  # χ² of one degree of freedom that one in a thousand exceeds: an explanation is surely worse
PAIRS_A_DOF = 6.0
"""Pairs for each degree of freedom of the mounting's variance where three variances are estimated from the same pairs. By
simulation of units without drift, 20 units of three calibrations whose stated uncertainty is a fifth of their scatter: |E_n| > 1
in 4.4 % (8.3 % with a coverage factor of 2)."""
SHORTEST_Y = 30.0 / 365.25
"""Calibrations that all lie within so many years tell no drift: a change over minutes is no drift, however large
it is a year."""
SPREAD_OF_SQUARES = 2.0  # variance of the square of a normal value of variance one


@dataclass(frozen=True)
class DeviceDrift:
    """How a kind of device drifts in one parameter; times in years.

    mean_slope, slope_sd : per year; walk_sd : per root year; mount_sd : of one mounting, beyond the stated uncertainty
    pairs : of calibrations, that these figures come from
    """

    mean_slope: float
    slope_sd: float
    walk_sd: float
    mount_sd: float
    pairs: int

    @property
    def parts(self) -> Array:
        """Variances of mounting, walk and slope, (3,)."""
        return np.array([self.mount_sd, self.walk_sd, self.slope_sd]) ** 2


def kind_of(change: Array, years: Array, known: Array) -> DeviceDrift:
    """How a kind drifts, from pairs of calibrations of the same units: moments of the changes, weighted, outliers left out.

    E(Δ²) = σ₁² + σ₂² + 2·mount² + walk²·t + slope²·t², solved with no negative part. Pairs should be of different lengths.
    Pairs closer
    than :data:`SHORTEST_Y` tell of mounting only; where all are, walk and slopes are zero, and :func:`drifts_known` says
    that they are not known.

    Parameters
    ----------
    change, years : (n,), difference of the pair's values and the time between; known : (n,), σ₁² + σ₂²
    """
    if change.size == 0:
        return DeviceDrift(0.0, 0.0, 0.0, 0.0, 0)
    expected = known + np.median((change**2 - known).clip(0.0)) + 1e-12
    mean, parts, keep = 0.0, np.zeros(3), np.ones_like(change, dtype=bool)
    for _ in range(ROUNDS):
        mean, keep, columns, target = _moments(change, years, known, expected, keep)
        parts = _parts(columns, target, (0, 1, 2) if drifts_known(years) else (0,))
        expected = known + _spread_of(parts, years) + 1e-12
    mount, walk, slope = np.sqrt(parts)
    return DeviceDrift(mean, float(slope), float(walk), float(mount), int(keep.sum()))


def drifts_known(years: Array) -> bool:
    """Whether any of some pairs lie far enough apart to tell a drift."""
    return bool(np.any(years >= SHORTEST_Y))


def prudent(kind: DeviceDrift, change: Array, years: Array, known: Array) -> DeviceDrift:
    """The kind as forecasts should take it: walk and slope alike where these explain the changes as well as mounting does.

    Pairs of one length do not tell mounting, walk and slope apart; drift that was taken for mounting was forecast to stand still.
    What the mean slope itself is uncertain by belongs to the slopes' spread.
    """
    if change.size == 0 or not drifts_known(years):
        return kind
    best = kind.parts
    expected = known + _spread_of(best, years) + 1e-12
    _, keep, columns, target = _moments(change, years, known, expected)
    alike = 0.5 * (_parts(columns, target, [1]) + _parts(columns, target, [2]))
    bearable = _left(columns, target, best) + SPREAD_OF_SQUARES * LIKELY
    tried = (alike, _parts(columns, target, [1, 2]), best)
    parts = next(trial for trial in tried if trial is best or _left(columns, target, trial) < bearable)
    mount, walk, slope = np.sqrt(parts)
    error = 1.0 / np.sqrt(np.sum((years**2 / expected)[keep]) + 1e-300)
    return replace(kind, slope_sd=float(np.hypot(slope, error)), walk_sd=float(walk), mount_sd=float(mount))


def seating_of(kind: DeviceDrift, change: Array, years: Array, known: Array, pairs: int) -> tuple[float, float]:
    """Standard deviation of mounting that a comparison of two calibrations has to allow for, and its degrees of freedom.

    Where mounting alone explains the changes of a kind not surely worse than with walk and slopes, all of what the stated
    uncertainties leave is mounting: pairs of one length do not part the two, and units without drift that were taken to walk
    disagreed in 10 to 25 % of their second calibrations. Elsewhere it is the kind's own.

    Parameters
    ----------
    change, years, known : (n,), as in :func:`kind_of`; pairs : how many of them are neighbouring calibrations
    """
    shown = kind.mount_sd, max(kind.pairs / PAIRS_A_DOF, 1.0)
    if change.size == 0 or not drifts_known(years):
        return shown
    best = kind.parts
    _, _, columns, target = _moments(change, years, known, known + _spread_of(best, years) + 1e-12)
    alone = _parts(columns, target, (0,))
    if _left(columns, target, alone) >= _left(columns, target, best) + SPREAD_OF_SQUARES * SURELY:
        return shown
    _, _, columns, target = _moments(change, years, known, known + 2.0 * alone[0] + 1e-12)
    return float(np.sqrt(_parts(columns, target, (0,))[0])), float(max(pairs - 1, 1))


def _moments(
    change: Array, years: Array, known: Array, expected: Array, keep: Flags | slice = slice(None)
) -> tuple[float, Flags, Array, Array]:
    """Mean slope of the pairs to keep, pairs that are no outliers, and their weighted squares with the columns that make them."""
    weight = np.where(years >= SHORTEST_Y, years, 0.0) / expected
    mean = float(np.sum(weight[keep] * change[keep]) / max(float(np.sum((weight * years)[keep])), 1e-300))
    left = change - mean * years
    keep = left**2 <= CLIP**2 * expected
    columns = np.column_stack([np.full(years.size, 2.0), years, years**2]) / expected[:, None]
    return mean, keep, columns[keep], ((left**2 - known) / expected)[keep]


def _parts(columns: Array, target: Array, kinds: Sequence[int] = (0, 1, 2)) -> Array:
    """Variances (3,) of mounting, walk and slope, none negative; those not asked for are zero."""
    chosen = columns[:, list(kinds)]
    scale = np.sqrt(np.sum(chosen**2, axis=0)) + 1e-300
    parts = np.zeros(3)
    parts[list(kinds)] = nnls(chosen / scale, target)[0] / scale
    return parts


def _left(columns: Array, target: Array, parts: Array) -> float:
    return float(np.sum((target - columns @ parts) ** 2))


def _spread_of(parts: Array, years: Array) -> Array:
    """Variance of a change over some years."""
    return 2.0 * parts[0] + parts[1] * years + parts[2] * years**2


@dataclass(frozen=True)
class LatestState:
    """Where every unit stands at its last calibration: level and slope per year, (units,), and their covariance.

    last : the value of that calibration; odd : distance of the unit's own slope from its kind's, in σ; NaN for a unit whose
        calibrations lie too close together to tell a slope of its own, which is then its kind's
    """

    level: Array
    slope: Array
    level_var: Array
    cross: Array
    slope_var: Array
    last: Array
    odd: Array


def standing(values: Array, errors: Array, years: Array, kind: DeviceDrift) -> LatestState:
    """Level and slope of every unit at its last calibration.

    A unit whose own history gives it a slope that the kind does not have is judged by that history: the spread of slopes
    counts for it as large as its own distance.

    Parameters
    ----------
    values, errors, years : (units, most), in order of time and filled up with NaN; errors are standard uncertainties
    """
    span = np.nanmax(years, axis=1) - years[:, 0]
    noise = np.sqrt(np.nanmean(errors**2, axis=1) + kind.mount_sd**2)
    unknown = kind.slope_sd + 10.0 * noise / np.maximum(span, 1e-3)
    alone = _filtered(values, errors, years, kind, unknown)
    expected = np.sqrt(alone.slope_var + kind.slope_sd**2)
    odd = (alone.slope - kind.mean_slope) / np.where(expected > 0.0, expected, np.inf)
    odd = np.where(span >= SHORTEST_Y, odd, np.nan)
    prior = np.where(np.abs(odd) > ODD, np.abs(alone.slope - kind.mean_slope), kind.slope_sd)
    return replace(_filtered(values, errors, years, kind, prior), odd=odd)


def _filtered(values: Array, errors: Array, years: Array, kind: DeviceDrift, slope_sd: Array) -> LatestState:
    units = values.shape[0]
    noise = errors**2 + kind.mount_sd**2
    level, slope = values[:, 0].copy(), np.full(units, kind.mean_slope)
    p00, p01 = noise[:, 0].copy(), np.zeros(units)
    p11 = slope_sd**2
    last, time = values[:, 0].copy(), years[:, 0].copy()
    for k in range(1, values.shape[1]):
        there = np.isfinite(values[:, k])
        t = np.where(there, years[:, k] - time, 0.0)
        level, p00 = level + slope * t, p00 + 2.0 * t * p01 + t**2 * p11 + kind.walk_sd**2 * t
        p01 = p01 + t * p11
        gain = np.where(there, 1.0, 0.0) / (p00 + np.where(there, noise[:, k], 1.0))
        g0, g1 = gain * p00, gain * p01
        surprise = np.where(there, values[:, k] - level, 0.0)
        level, slope = level + g0 * surprise, slope + g1 * surprise
        p00, p01, p11 = p00 * (1.0 - g0), p01 * (1.0 - g0), p11 - g1 * p01
        last, time = np.where(there, values[:, k], last), np.where(there, years[:, k], time)
    return LatestState(level, slope, p00, p01, np.maximum(p11, 0.0), last, np.zeros(units))


def forecast(now: LatestState, kind: DeviceDrift, ahead: Array, *, origin: Array | float) -> tuple[Array, Array]:
    """Expected value less ``origin`` and its standard deviation, (units, times), for times ``ahead`` (times,) in years.

    The deviation is that of the prediction of the true value: what is not known of level and slope, and the walk to come.
    """
    t = ahead[None, :]
    mean = (now.level - origin)[:, None] + now.slope[:, None] * t
    var = now.level_var[:, None] + 2.0 * t * now.cross[:, None] + t**2 * now.slope_var[:, None] + kind.walk_sd**2 * t
    return mean, np.sqrt(var)


def in_tolerance(mean: Array, deviation: Array, tolerance: float) -> Array:
    """Probability that a value lies within ± ``tolerance``; the arrays' shape."""
    spread = np.maximum(deviation, 1e-300)
    return norm.cdf((tolerance - mean) / spread) - norm.cdf((-tolerance - mean) / spread)


def first_time(condition: Flags, ahead: Array) -> Array:
    """The first of the times (times,) at which a condition (units, times) holds; infinity where it never does."""
    first = np.argmax(condition, axis=1)
    return np.where(condition.any(axis=1), ahead[first], np.inf)


def leaves(mean: Array, deviation: Array, tolerance: float, ahead: Array) -> tuple[Array, Array, Array]:
    """When values leave ± ``tolerance``: expected time, and the 95 % interval of it, (units,) each, years ahead."""
    size, reach = np.abs(mean), NORMAL_95 * deviation
    expected, soonest, latest = (first_time(bound > tolerance, ahead) for bound in (size, size + reach, size - reach))
    return expected, soonest, latest


def last_reliable(probability: NDArray[np.floating[Any]], target: float, ahead: Array) -> Array:
    """The longest time for which the probability (units, times) of being in tolerance stays at the target, (units,), years.

    The reliability target of an interval (NCSL RP-1, chapter 2): the interval ends where the probability falls to it.
    """
    bad = probability < target
    first = np.argmax(bad, axis=1)
    before = ahead[np.maximum(first - 1, 0)]
    return np.where(bad.any(axis=1), np.where(first == 0, 0.0, before), ahead[-1])
