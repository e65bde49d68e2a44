"""Static stretches of a raw record, found from the record itself."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import Array, Flags, Index, runs_of

_BINS = 256  # of the histogram of log scatter (Otsu's threshold)


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
        """How many intervals there are."""
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
    below three times and never above ten times the quietest stretch: nothing is set for one data set. A record that
    never moves is one interval.

    Parameters
    ----------
    x : (n, 3), any unit
    rate_hz : Hz
    window_s : length of the sliding window, s
    shortest_s : shortest interval that counts after trimming, s
    threshold : standard deviation of a window above which it moves, in the unit of the record; found in the record by default
    """
    data = np.asarray(x, dtype=np.float64)
    width = max(3, round(window_s * rate_hz))
    if data.shape[0] < 3 * width:
        raise ValueError(
            f"static: record of {data.shape[0]} samples, at least {3 * width} are needed ({3 * window_s} s); record longer"
        )
    sd = np.sqrt(moving_variance(data, width).sum(axis=-1))
    quiet = _quietest(sd, width)
    limit = _threshold(sd, quiet) if threshold is None else threshold
    inside = _spread(sd <= limit, width, data.shape[0])
    trim = round(0.5 * window_s * rate_hz)  # taken off both ends, where the hand still lets go
    start, stop = runs_of(inside)
    # the ends of the record are no hand's doing: nothing is trimmed there
    start = np.where(start > 0, start + trim, start)
    stop = np.where(stop < data.shape[0], stop - trim, stop)
    kept = stop - start >= max(2, round(shortest_s * rate_hz))
    return StaticIntervals(start[kept], stop[kept], quiet, limit)


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


def _threshold(sd: Array, quiet: float) -> float:
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
    return float(np.clip(best, 3.0 * quiet, 10.0 * quiet))


def _spread(still: Flags, width: int, n: int) -> Flags:
    """Samples (n,) that lie in at least one still window."""
    edges = np.zeros(n + 1, dtype=np.int64)
    starts = np.flatnonzero(still)
    np.add.at(edges, starts, 1)
    np.add.at(edges, starts + width, -1)
    return np.cumsum(edges[:-1]) > 0
