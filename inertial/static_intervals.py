"""Static stretches of a raw record, found from the record itself."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import uniform_filter1d

from inertial.arrays import Array, Flags, Index, runs_of

_BINS = 256  # of the histogram of log scatter (Otsu's threshold)
_WHOLE, _SLOW = (3.0, 10.0), (2.0, 4.0)
"""Least and largest limit in multiples of the quietest stretch: of a window as it is, and without its vibrations."""
_SMOOTHED = 0.2
"""Part of a window over which a vibration is averaged out, twice: of 1 s, 5 Hz leaves nothing and 3 Hz a quarter."""
_TURNED, _SHAKEN = 0.001, 0.15
"""Scatter of a window over that of the whole record, which is about gravity where the sensor is turned: slow scatter below the
first moves no mean by a millig; scatter above the second is motion, though its mean may stand still."""


@dataclass(frozen=True)
class StaticIntervals:
    """Where a record stands still, and how that was decided."""

    start: Index
    """(k,) first sample of each interval."""
    stop: Index
    """(k,) one past the last sample."""
    quiet_sd: float
    """Standard deviation of the quietest stretch (all axes, root of the sum of squares), unit of the record."""
    threshold_sd: float
    """A window above this standard deviation moves."""

    def __len__(self) -> int:
        return int(self.start.size)


def find(
    x: ArrayLike,
    rate_hz: float,
    *,
    window_s: float = 1.0,
    shortest_s: float = 1.0,
    threshold: float | None = None,
) -> StaticIntervals:
    """Static intervals of a record of three axes.

    The standard deviation in a sliding window is compared with that of the quietest stretch. The threshold lies where it
    best divides the logarithms of all windows' variances into two kinds (N. Otsu, IEEE Trans. SMC 9 (1979) 62), never
    below three times and never above ten times the quietest stretch: nothing is set for one data set. What is compared is
    the record without its vibrations, whose scatter is no motion; a window as loud as a hand that shakes moves as well.
    A record that never moves is one interval.

    Parameters
    ----------
    x : (n, 3), any unit
    rate_hz : Hz
    window_s : length of the sliding window, s
    shortest_s : shortest interval that counts after trimming, s
    threshold : standard deviation of a window above which it moves, in the unit of the record, its vibrations included;
        found in the record by default
    """
    data = np.asarray(x, dtype=np.float64)
    width = max(3, round(window_s * rate_hz))
    if data.shape[0] < 3 * width:
        raise ValueError(
            f"static: record of {data.shape[0]} samples, at least {3 * width} are needed ({3 * window_s} s); record longer"
        )
    sd = np.sqrt(moving_variance(data, width).sum(axis=-1))
    quiet = _quietest(sd, width)
    half = round(_SMOOTHED * window_s * rate_hz)
    slow, gain = _smoothed(data, half)
    size = float(np.sqrt(slow.var(axis=0).sum()))
    slow_sd = np.sqrt(moving_variance(slow, width).sum(axis=-1))
    # of few independent values the quietest is far below the usual: white noise leaves its share of the whole at least
    slow_quiet = max(_quietest(slow_sd, width), gain * quiet)
    slow_limit = max(
        _threshold(slow_sd, slow_quiet, _SLOW if half > 1 else _WHOLE), _TURNED * size * min(1.0, window_s)
    )
    limit = max(_threshold(sd, quiet, _WHOLE), _SHAKEN * size) if threshold is None else threshold
    start, stop = _intervals((sd <= limit) & (slow_sd <= slow_limit), width, data, 2.0 * slow_limit)
    shortest, most = max(2, round(shortest_s * rate_hz)), round(0.5 * window_s * rate_hz)
    # half a window is taken off both ends, where the hand still lets go; of short ones what the smoothing has not taken
    trim = np.clip((stop - start - shortest) // 2, most - (half if half > 1 else 0), most)
    # the ends of the record are no hand's doing: nothing is trimmed there
    start = np.where(start > 0, start + trim, start)
    stop = np.where(stop < data.shape[0], stop - trim, stop)
    lasting = stop - start >= shortest
    return StaticIntervals(start[lasting], stop[lasting], quiet, limit)


def quiet_sd(x: Array, rate_hz: float, window_s: float) -> float:
    """Standard deviation of a window in the quietest stretch of a record (n, 3), all axes: what :func:`find` compares with."""
    width = max(3, round(window_s * rate_hz))
    return _quietest(np.sqrt(moving_variance(x, width).sum(axis=-1)), width)


def _smoothed(x: Array, width: int) -> tuple[Array, float]:
    """A record (n, 3) without its vibrations, by two means over `width` samples; the part of white noise that is left."""
    if width < 2:
        return x, 1.0
    smooth = uniform_filter1d(uniform_filter1d(x, width, axis=0, mode="nearest"), width, axis=0, mode="nearest")
    return smooth, float(np.sqrt((2.0 * width**2 + 1.0) / (3.0 * width**3)))


def moving_variance(x: Array, width: int) -> Array:
    """Variance in each window of `width` samples, (n - width + 1, ...)."""
    centred = x - x.mean(axis=0)
    pad = np.zeros((1, *x.shape[1:]))
    first = np.concatenate([pad, np.cumsum(centred, axis=0)])
    second = np.concatenate([pad, np.cumsum(centred**2, axis=0)])
    mean = (first[width:] - first[:-width]) / width
    return np.maximum((second[width:] - second[:-width]) / width - mean**2, 0.0) * width / (width - 1)


def _quietest(sd: Array, width: int) -> float:
    """Level of the quietest stretch: the least median over three window lengths, which one lucky window cannot set."""
    usable = sd.size // (3 * width) * 3 * width
    blocks = sd[:usable].reshape(-1, 3 * width) if usable else sd[None, :]
    levels = np.median(blocks, axis=1)
    moving = levels[levels > 0.0]
    return float(moving.min()) if moving.size else 0.0


def _threshold(sd: Array, quiet: float, times: tuple[float, float]) -> float:
    """Standard deviation that divides still from moving."""
    positive = sd[sd > 0.0]
    if positive.size == 0 or quiet <= 0.0:
        return 0.0
    counts, edges = np.histogram(np.log(positive), bins=_BINS)
    centres = 0.5 * (edges[:-1] + edges[1:])
    weight = np.cumsum(counts) / counts.sum()
    mean = np.cumsum(counts * centres) / counts.sum()
    inner = (weight > 0.0) & (weight < 1.0)
    between = np.zeros_like(weight)
    between[inner] = (mean[-1] * weight[inner] - mean[inner]) ** 2 / (weight[inner] * (1.0 - weight[inner]))
    best = float(np.exp(edges[1 + int(np.argmax(between))]))
    return float(np.clip(best, times[0] * quiet, times[1] * quiet))


def _intervals(still: Flags, width: int, x: Array, apart: float) -> tuple[Index, Index]:
    """First samples of the runs of still windows and one past their last; runs that touch are one where their means agree.

    Parameters
    ----------
    apart : distance of means from which they are two positions logged back to back
    """
    start, stop = runs_of(still)
    joined: list[list[int]] = []
    for first, last in zip(start.tolist(), (stop + width - 1).tolist(), strict=True):
        before = joined[-1] if joined and first <= joined[-1][1] else None
        if before and np.linalg.norm(x[first:last].mean(axis=0) - x[before[0] : before[1]].mean(axis=0)) <= apart:
            before[1] = last
        else:
            joined.append([first, last])
    edges = np.array(joined, dtype=np.int64).reshape(-1, 2)
    return edges[:, 0], edges[:, 1]
