"""What a bias is the bias of: the mean of its record, of a longer time, of another switch-on; and how far these lie apart."""

from typing import TypeVar

import numpy as np

from inertial.arrays import Array, Flags

_Time = TypeVar("_Time", float, Array)

DAY_S = 86_400.0
"""Window of a unit's long mean, s: the day after the record. Flicker has no mean for ever: a decade more adds B²·ln 10/π."""

_OCTAVE = float(np.log(2.0))


def between_means(first: float, second: float, gap: float = 0.0) -> float:
    """Variance, for flicker with B = 1, of the difference of its means over two windows.

    u² = (1/π)·(2L − ln a − ln b + 3) with L the mean of ln|s − t| over both windows: from the one-sided density B²/(π·f),
    for which
    E(x(s) − x(t))² grows as (2/π)·ln|s − t|. What is slower than both does not count, so it needs no lowest frequency.

    Parameters
    ----------
    first, second, gap : lengths a and b of the windows and the time between them, s
    """

    def integral(x: float) -> float:
        return 0.5 * x * x * float(np.log(x)) - 0.75 * x * x if x > 0.0 else 0.0

    area = integral(gap + first + second) - integral(gap + first) - integral(gap + second) + integral(gap)
    apart = area / (first * second)
    return max((2.0 * apart - float(np.log(first)) - float(np.log(second)) + 3.0) / np.pi, 0.0)


def instability(deviation: Array, time: Array, *, slowest: float = 1.0) -> Array:
    """Bias instability B of the flicker that has a standard deviation between dwells; the deviation's shape and unit.

    The flicker of a fit is a sum of Ornstein–Uhlenbeck processes an octave apart, from a third of the spacing of the dwells to
    ``slowest`` times the record; each has the variance B²·ln 2/π (:func:`inertial.noise.dwells.flicker_of_means`).

    Parameters
    ----------
    time : (n,), s, of the dwells
    """
    when = np.unique(time)
    span = float(np.ptp(when))
    if not span > 0.0:
        return np.full_like(deviation, np.nan)
    octaves = max(int(np.ceil(np.log2(3.0 * slowest * span / float(np.median(np.diff(when)))))), 2)
    return deviation * np.sqrt(np.pi / (octaves * _OCTAVE))


def walk_kernel(time: Array, fitted: Flags | None = None) -> Array:
    """Covariance (..., n, n) of a random walk about its mean over its record, which gathers a variance of one over all times.

    About a walk that is zero at the first dwell, the bias of a fit would be that of the first dwell. Where a bias is fitted,
    nothing but the bias depends on what the walk is counted from.

    Parameters
    ----------
    time : (..., n), s
    fitted : (n,), the dwells whose time is the record; all where None
    """
    record = time if fitted is None else time[..., fitted]
    first = time.min(axis=-1, keepdims=True)
    start = record.min(axis=-1, keepdims=True)
    along, of_mean = walk_mean(time, first, start, record.max(axis=-1, keepdims=True) - start)
    since = time - first
    shared = np.minimum(since[..., :, None], since[..., None, :])
    return (shared - along[..., :, None] - along[..., None, :] + of_mean[..., None]) / max(float(np.ptp(time)), 1e-9)


def walk_mean(time: Array, since: _Time, start: _Time, length: _Time) -> tuple[Array, _Time]:
    """Covariance (..., n) of a random walk with its mean over a window, and that mean's variance; K = 1, zero at ``since``.

    Parameters
    ----------
    time : (..., n), s; since, start : s; length : of the window, s
    """
    before, inside = start - since, np.clip(time - start, 0.0, length)
    along = np.asarray(np.minimum(time - since, before) + inside - 0.5 * inside**2 / np.maximum(length, 1e-9))
    return along, before + length / 3.0


def flicker_mean(time: Array, constants: Array, start: float, length: float) -> tuple[Array, float]:
    """As :func:`walk_mean`, of a sum of Ornstein–Uhlenbeck processes of equal variance, in total one, at times in the window.

    Parameters
    ----------
    constants : (k,), time constants of the processes, s
    """
    inside = np.clip(time - start, 0.0, length)
    along, of_mean = np.zeros(time.shape), 0.0
    for tau in constants.tolist():
        share = tau / max(length, 1e-9)
        along += share * (2.0 - np.exp(-inside / tau) - np.exp(-(length - inside) / tau))
        of_mean += 2.0 * share * (1.0 + share * float(np.expm1(-1.0 / share)))
    return along / constants.size, of_mean / constants.size


def against_mean(variance: Array, gain: Array, kind: tuple[Array, float]) -> Array:
    """Change of a coefficient's variance where its true value includes the mean of the wander over a window.

    The wander v adds the error gᵀ·v to the coefficient; relative to the mean m the error is gᵀ·v − m, whose variance is that of
    gᵀ·v plus var(m) − 2·gᵀ·cov(v, m). A fit follows the wander of its record.

    Parameters
    ----------
    variance : (...), of the wander; gain : (..., n), g; kind : cov(v, m)/variance and var(m)/variance
    """
    along, of_mean = kind
    return variance * (of_mean - 2.0 * gain @ along)


def of_a_day(
    record: Array,
    wander: Array,
    time: Array,
    *,
    slowest: float = 1.0,
    widened: float = 1.0,
) -> Array:
    """Standard uncertainty of a bias as the mean of the day after its record, from 1/f noise; the shape of ``record``.

    Flicker between the record and that day is added to the error of the record's mean.

    Parameters
    ----------
    record : standard uncertainty of the record's mean; wander : standard deviation of the 1/f wander between dwells
    time : (n,), s, of the dwells; slowest : as in :func:`instability`
    widened : factor of the wander's share, as it is known from few degrees of freedom
    """
    span = float(np.ptp(time))
    if not span > 0.0:
        return np.full_like(record, np.nan)
    flicker = instability(wander, time, slowest=slowest) * np.sqrt(between_means(span, DAY_S))
    return np.hypot(record, widened * flicker)
