"""What the samples of a raw record show before any physics: resolution, clipping, axes that stand still, torn words.

All tests look at one axis at a time and need nothing to be known of poses or noise: what is usual is measured in the record.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import median_filter

from inertial.arrays import NORMAL_MEDIAN, Array, Flags, Index, runs_of

_MOST_DISTINCT = 200_000
_BLOCK = 64  # samples over which the share of equal neighbours is measured
_COARSE = 0.97
"""Share of equal neighbours from which on a quiet axis cannot be distinguished from a constant one."""
_CHANCE = 1e-6
"""Probability, over the whole record, of a run of equal samples that chance makes."""
_SHORTEST_RUN = 12
_WING = 6.0
"""Robust standard deviations beyond which a sample is no noise: 2e-9 of normal ones."""
_LEAST_WINGS = 5  # blocks with samples off by one power of two
_POWERS = range(3, 24)
_BESIDE = (0.75, 1.25, 1.5)
_WIDEST = 0.12  # of a power: the bands beside it stay apart from it
_CLEARLY = 4
_SINGLE = 1.5
_SAME_STEP = 1e-9  # relative: that of whole numbers stays whole
_AT_LIMIT = 4
_FEW_DIGITS, _FEWEST_QUIET, _MOSTLY = 6.0, 5, 0.9
"""Digits that noise spans in a quiet block, at most; blocks from which it is known; share of them that are alike."""
_MEDIAN = 15  # samples of the running median: it follows a hand, and one sample in ten does not move it
_CALM = 3.0
"""Times the spread of the quieter blocks, up to which a block is quiet."""


@dataclass(frozen=True)
class Frozen:
    """A stretch of samples in which an axis repeats its last value although it has noise elsewhere."""

    axis: int
    start: int
    stop: int

    @property
    def count(self) -> int:
        """Samples in it."""
        return self.stop - self.start


@dataclass(frozen=True)
class Torn:
    """Samples of an axis that are off by powers of two of the resolution: high and low byte of different readings.

    rows : (m,), samples · offsets : powers of two in steps of the resolution, the most frequent first · share : of all samples
    """

    axis: int
    rows: Index
    offsets: tuple[int, ...]
    share: float


def resolution(values: ArrayLike) -> float | None:
    """Step of the lattice that the samples (n,) of an axis lie on, in their unit; None where they lie on none."""
    distinct = np.unique(np.asarray(values, dtype=np.float64)[:_MOST_DISTINCT])
    if distinct.size < 3:
        return None
    gaps = np.diff(distinct)
    rounding = 1e-9 * float(np.max(np.abs(distinct))) + 1e-300
    gaps = gaps[gaps > rounding]
    if gaps.size < 2:
        return None
    step = float(gaps.min())
    # printed decimals move a gap by a digit: the step that fits all gaps best, from those close to the smallest
    near = gaps[gaps < 1.5 * step]
    step = _refined(float(np.median(near)), gaps)
    single = float(np.spacing(np.float32(np.max(np.abs(distinct)))))
    if step < _SINGLE * single and not np.array_equal(distinct, np.rint(distinct)):
        return None  # the lattice of single precision, not that of a converter
    for multiple in (1, 2, 3):
        fits = gaps / (step / multiple)
        off = np.abs(fits - np.rint(fits)) * (step / multiple)
        if np.mean(off < 0.15 * step / multiple + rounding) > 0.98 and np.median(fits) < 1e5:
            return step / multiple
    return None


def _refined(step: float, gaps: Array) -> float:
    """A step by least squares from ever longer gaps: one printed with few digits is right to a few per cent only at first."""
    for reach in (3.0, 9.0, 27.0, 81.0):
        used = gaps[gaps < reach * step]
        steps = np.rint(used / step)
        fitted = float(np.sum(used * steps) / np.sum(steps**2))
        step = step if abs(fitted - step) < _SAME_STEP * step else fitted
    return step


def clipped(values: ArrayLike) -> tuple[float, float, int]:
    """Lowest and highest sample (n,), and how many lie at an extreme in runs of four or more, as at the end of a range.

    An extreme counts only where the axis reaches it in a run and never goes beyond: 0 where it does not clip.
    """
    x = np.asarray(values, dtype=np.float64)
    low, high = float(x.min()), float(x.max())
    usual = x.size / (1.0 + float(np.count_nonzero(np.diff(x))))  # mean length of runs of equal samples
    count = 0
    if low < high:
        for extreme in (low, high):
            start, stop = runs_of(x == extreme)
            long = stop - start >= _AT_LIMIT
            # noise that only touches its extreme does so in single samples
            if np.count_nonzero(long) and np.mean((stop - start)[long]) > 2 * usual:
                count += int(np.sum((stop - start)[long]))
    return low, high, count


def frozen(x: ArrayLike) -> list[Frozen]:
    """Stretches in which one axis of a record (n, 3) stands still although it is noisy elsewhere.

    A run of equal samples counts when chance makes so long a one once in a million records. How often neighbours are equal by
    chance is measured in blocks of the same axis, and the least lively of those that are not still decides. An axis whose
    neighbours are nearly always equal is too coarse to judge, and so is one whose noise reaches the next digit only near the
    middle between two; one that never changes at all is a stretch of the whole record where another axis does.
    """
    data = np.asarray(x, dtype=np.float64)
    n, axes = data.shape
    stretches: list[Frozen] = []
    lively = [bool(np.any(np.diff(data[:, k]) != 0.0)) for k in range(axes)]
    for axis in range(axes):
        if not lively[axis]:
            if any(lively) and n >= _SHORTEST_RUN:
                stretches.append(Frozen(axis, 0, n))
            continue
        equal = np.diff(data[:, axis]) == 0.0
        usual = _usual_share(equal)
        if usual is None or _between_two_digits(data[:, axis]):
            continue
        shortest = max(_SHORTEST_RUN, int(np.ceil(np.log(_CHANCE / n) / np.log(usual))))
        start, stop = runs_of(equal)
        stretches += [Frozen(axis, int(a), int(b) + 1) for a, b in zip(start, stop, strict=True) if b - a >= shortest]
    return stretches


def _between_two_digits(x: Array) -> bool:
    """Whether nearly all quiet blocks of an axis (n,) that change at all hold two neighbouring digits: its noise is below one.

    Elsewhere between two digits such an axis stands still for minutes, and nothing is wrong with it.
    """
    step = resolution(x)
    if step is None:
        return False
    size = min(_BLOCK, max(8, x.size // 4))
    blocks = x[: x.size // size * size].reshape(-1, size)
    span = np.rint(np.ptp(blocks, axis=1) / step)
    quiet = span[(span > 0.0) & (span <= _FEW_DIGITS)]
    return quiet.size >= _FEWEST_QUIET and float(np.mean(quiet == 1.0)) > _MOSTLY


def _usual_share(equal: Flags) -> float | None:
    """Share of equal neighbours in the block that has most of them by chance; None where chance cannot be measured."""
    size = min(_BLOCK, max(8, equal.size // 4))
    blocks = equal[: equal.size // size * size].reshape(-1, size).mean(axis=1)
    usual = blocks[blocks < _COARSE]
    if usual.size < max(2, 0.02 * blocks.size):
        return None
    # a block that a still stretch enters is half still: not one of the many
    return float(np.clip(np.quantile(usual, 0.9), 0.05, _COARSE))


def torn(x: ArrayLike) -> list[Torn]:
    """Samples of a record (n, 3) that lie powers of two of the resolution off the samples about them.

    Compared is with the running median, and only in quiet blocks, so that neither poses nor static stretches need be known, and a
    fault that all dwells have is seen as well. What a hand does in between is no power of two.
    """
    data = np.asarray(x, dtype=np.float64)
    faults: list[Torn] = []
    for axis in range(data.shape[1]):
        step = resolution(data[:, axis])
        if step is None or data.shape[0] < 4 * _BLOCK:
            continue
        rows, offsets, quiet = _wings(data[:, axis], step)
        if rows.size:
            kinds, often = np.unique(offsets, return_counts=True)
            order = np.argsort(-often)
            faults.append(Torn(axis, rows, tuple(int(kinds[k]) for k in order[:4]), rows.size / quiet))
    return faults


def running_median(x: Array) -> Array:
    """Median of each sample (n,) and its neighbours; at the ends of those that there are."""
    return np.asarray(median_filter(x, _MEDIAN, mode="mirror"), dtype=np.float64)


def _wings(x: Array, step: float) -> tuple[Index, Index, int]:
    """Samples off by a power of two, the powers, and how many samples were looked at.

    A power counts when several blocks have samples that far off, and clearly more do than lie at three quarters, five quarters
    and one and a half times as far: what a hand or a knock leaves in quiet blocks is spread over all distances.
    """
    away = x - running_median(x)
    blocks = away[: away.size // _BLOCK * _BLOCK].reshape(-1, _BLOCK)
    spread = np.maximum(np.median(np.abs(blocks), axis=1) / NORMAL_MEDIAN, step / np.sqrt(12.0))
    calm = np.flatnonzero(spread <= _CALM * np.quantile(spread, 0.25))
    calm_spread = spread[calm, None]
    size = np.abs(blocks[calm])
    hits, offsets = np.zeros(size.shape, dtype=bool), np.zeros(size.shape, dtype=np.int64)
    for power in (2**k for k in _POWERS):
        centre = power * step
        width = np.minimum(4.5 * calm_spread + step, _WIDEST * centre)
        usable = centre > _WING * calm_spread
        at = [usable & (np.abs(size - part * centre) < width) for part in (1.0, *_BESIDE)]
        count, *beside = (int(np.count_nonzero(band)) for band in at)
        spread_out = int(np.count_nonzero(at[0].any(axis=1)))
        if spread_out >= _LEAST_WINGS and count >= _LEAST_WINGS + _CLEARLY * max(beside):
            hits |= at[0]
            offsets[at[0]] = power
    rows, columns = np.nonzero(hits)
    return (calm[rows] * _BLOCK + columns).astype(np.int64), offsets[hits], calm.size * _BLOCK
