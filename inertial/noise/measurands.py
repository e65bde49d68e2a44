"""What a bias is the bias of: the mean of its record, of a longer time, of another switch-on; and how far these lie apart."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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


def walked(record: float, later: float = 0.0) -> float:
    """Variance, for a random walk of K = 1, of its mean over some time against its value at the start of a record.

    The coefficient of a fit is the bias at its first dwell: its walk is zero there. Its mean over the record is a/3 off that;
    its mean over a time b that follows, a + b/3.

    Parameters
    ----------
    record, later : lengths a and b, s; the mean is that over the record where ``later`` is zero
    """
    return record + later / 3.0 if later > 0.0 else record / 3.0


def of_the_record(error: Array, walk: Array) -> Array:
    """Standard uncertainty of a bias as the mean of its record, from that of its value at the first dwell.

    Parameters
    ----------
    error : standard error of the coefficient; walk : standard deviation of the random walk at the last dwell
    """
    return np.hypot(error, walk * np.sqrt(walked(1.0)))


def of_a_day(
    record: Array,
    wander: Array,
    time: Array,
    *,
    walk: Array | float = 0.0,
    slowest: float = 1.0,
    widened: float = 1.0,
) -> Array:
    """Standard uncertainty of a bias as the mean of the day after its record; the shape and unit of ``record``.

    Flicker between the record and that day, and the random walk since the first dwell, are added to the coefficient's error.

    Parameters
    ----------
    record : standard error of the coefficient; wander : standard deviation of the 1/f wander between dwells
    walk : standard deviation of the random walk at the end of the record
    time : (n,), s, of the dwells; slowest : as in :func:`instability`
    widened : factor of the wander's share, as it is known from few degrees of freedom
    """
    span = float(np.ptp(time))
    if not span > 0.0:
        return np.full_like(record, np.nan)
    flicker = instability(wander, time, slowest=slowest) * np.sqrt(between_means(span, DAY_S))
    return np.hypot(record, widened * np.hypot(flicker, walk * np.sqrt(walked(span, DAY_S) / span)))
