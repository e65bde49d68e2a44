"""What spoils a recorded pulse or step: samples that depart alone, a top that is cut off flat, a second pulse in the record."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from inertial.arrays import NORMAL_MEDIAN, Array, Index, runs_of
from inertial.dynamics.pulses import HALF_WIDTH, low_passed, span

FINE, CLOSE = 24.0, 12
"""Samples of a pulse from which on a lone one shows, and those about it that are smooth."""


def lone_samples(record: Array, rate_hz: float, duration_s: float, share: float = 0.1) -> Index:
    """Samples (m,) of a record (n,) that depart alone or with a neighbour, by a ``share`` of its range and above the noise.

    A sample departs from the cubic through the two smooth samples on each side of it, and of the neighbour that is off with it:
    a faulty data line. A pulse bends nearly the same everywhere, and a ringing changes it from sample to sample. Of neighbours
    that depart together one is given, to a sample. None where a pulse has few samples, and kinks as sharp.
    """
    if rate_hz * duration_s < FINE or record.size < 2 * CLOSE:
        return np.zeros(0, dtype=np.intp)
    limit = share * float(np.ptp(record))
    found = _departing(record, limit, 1)
    pairs = [k for k in _departing(record, limit, 2) if not np.any(np.abs(found - k) <= 2)]
    return np.sort(np.append(found, np.array(pairs, dtype=np.intp)))


def _departing(record: Array, limit: float, count: int) -> Index:
    """First samples (m,) of ``count`` neighbours that depart together from what is about them by more than a limit."""
    beside = np.array([-2.0, -1.0, count, count + 1.0])
    to_cubic = np.linalg.solve(np.vander(beside, 4).T, np.vander(np.arange(count, dtype=np.float64), 4).T)
    windows = np.lib.stride_tricks.sliding_window_view(record, count + 4)
    off = windows[:, 2:-2] - windows[:, [0, 1, -2, -1]] @ to_cubic
    size = np.pad(np.abs(off).max(axis=1), (2, count + 1))  # of the neighbours that begin at a sample
    limit = max(limit, 12.0 * float(np.median(size)))
    last, reach = record.size - 1, 2 * count  # a sample that is off enters what is expected of those within this reach
    return np.array(
        [
            k
            for k in np.flatnonzero(size > limit)
            if size[k] == size[max(k - reach, 0) : k + reach + 1].max()
            and abs(record[min(k + count + 1, last)] - record[max(k - 2, 0)]) < 0.5 * size[k]  # an edge stays
            and max(
                size[max(k - CLOSE, 0) : max(k - reach, 0)].max(initial=0.0),
                size[k + reach + 1 : k + CLOSE].max(initial=0.0),
            )
            < 0.25 * size[k]
        ],
        dtype=np.intp,
    )


BAND = 3.0  # standard deviations of the noise on each side within which samples stand at one height
LONGER = 1.5  # times the samples of a half sine that stand so: those of a cut top
CORNER, BESIDE = 2.0, 0.1
"""A cut top ends in corners: beside it, within a tenth of its length, the record falls by twice the band at least."""
FEWEST_FLAT = 5


def flat_top(record: Array, rate_hz: float, duration_s: float, noise: float, baseline: float) -> int:
    """Samples at the top of a pulse (n,) that stand at one height within the noise, where a half sine bends; 0 for none.

    A half sine stays within a band b of its peak A for D·(2/π)·arccos(1 − b/A); a top that is cut off stays longer and ends in
    corners, where a rounded one falls off by little.

    Parameters
    ----------
    noise : standard deviation of a sample; baseline : the record before the pulse
    """
    y = median_filter(record - baseline, 5) if record.size > FEWEST_FLAT else record - baseline
    y = y if y.max() >= -y.min() else -y
    height = float(y.max())
    band = 2.0 * BAND * max(noise, 1e-6 * height)
    if not height > 4.0 * band:
        return 0
    first, last = span(y, int(np.argmax(y)), height - band)
    count = last - first + 1
    usual = rate_hz * duration_s * 2.0 / np.pi * float(np.arccos(1.0 - band / height))
    # by the phase of the samples and their noise, one more at each end stands so
    if count < max(LONGER * (usual + 2.0), FEWEST_FLAT):
        return 0
    away = max(round(BESIDE * count), 2)
    sides = y[max(first - away, 0)], y[min(last + away, y.size - 1)]
    return count if height - band - max(sides) > CORNER * band else 0


OTHER = 0.1  # of the largest peak: what is smaller may be the rumble of a machine
RISES = 2.0  # times what is before it: a ringing falls off, and beats of two by less


@dataclass(frozen=True)
class OtherPulse:
    """Another pulse in a record: times of its peak and of its beginning, s from that of the record, and its peak."""

    at_s: float
    begins_s: float
    peak: float


def other_pulses(record: Array, rate_hz: float, duration_s: float) -> tuple[list[OtherPulse], list[OtherPulse]]:
    """The pulses of a record (n,) before its largest one, and after it, the nearest first.

    One counts that is at least a tenth of the largest, as long as a quarter of it, and rises to twice what the record shows
    over a duration before it: a ringing behind a pulse falls off, and has no quiet before it.
    """
    rest = float(np.median(record))
    y = low_passed(record - rest, rate_hz, duration_s)
    noise = float(np.median(np.abs(y))) / NORMAL_MEDIAN
    size = np.abs(y)
    top, lasting = int(np.argmax(size)), max(round(duration_s * rate_hz), 1)
    limit = max(OTHER * size[top], 8.0 * noise)
    low, high = span(size, top, OTHER * float(size[top]))
    found: tuple[list[OtherPulse], list[OtherPulse]] = [], []
    for start, stop in zip(*runs_of(size > 0.5 * limit), strict=True):
        if start <= high and stop > low:
            continue
        peak = start + int(np.argmax(size[start:stop]))
        first, last = span(size, peak, 0.5 * float(size[peak]))
        quiet = size[max(start - lasting, high if start > high else 0) : start]
        if (
            size[peak] > limit
            and last - first + 1 > 0.25 * HALF_WIDTH * lasting
            and quiet.size > 0.5 * lasting
            and size[peak] > RISES * quiet.max()
        ):
            pulse = OtherPulse(peak / rate_hz, start / rate_hz, float(y[peak]))
            found[int(start > high)].append(pulse)
    return found[0][::-1], found[1]
