"""Changes of level in a series: when, how much, and between which points they may lie."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from inertial.arrays import NORMAL_MEDIAN, Array
from inertial.population.memory import drawn_in, innovations, memories_of, memory_of

FEWEST = 4  # points on either side
LIKELY = 7.35  # −2·ln(1 − √0.95): twice the log-likelihood within which it lies with 95 % (Hansen 2000, table 1)
DRAWN_IN = 4.0
DOF_OF_DIFFERENCES = 1.3
PLACES, GROWTH = 0.65, 0.68
"""Degrees of freedom per difference of neighbours, and number of independent places, 0.65·n^0.68, of the largest statistic of a
white series whose wild values are drawn in, by simulation: the 99, 99.9 and 99.99 % quantiles of 10 000 series each of 20, 40,
100 and 250 points (3.2 … 3.5, 4.0 … 4.2, 4.6 … 5.2) are those of Student's distribution with 0.47·n^0.68 places; a third more
for safety. All places by themselves (Bonferroni) made a p-value of a white series ten times too large."""


@dataclass(frozen=True)
class ChangePoint:
    """One change of level.

    first : index of the first point after it; low, high : earliest and latest that ``first`` may be, 95 %
    shift, error : level after minus level before and its standard error with the correlation found, the values' unit
    p_value : that noise of this length shows as large a change anywhere, averaged over the correlations of neighbours that the
        series may have
    """

    first: int
    low: int
    high: int
    shift: float
    error: float
    p_value: float

    @property
    def significance(self) -> float:
        """|shift| in standard errors."""
        return abs(self.shift) / self.error


def change_points(values: Array, level: float = 1e-3) -> list[ChangePoint]:
    """The changes of level of a series (n,), found by binary segmentation, each then placed between its neighbours.

    Judged are the innovations of the series, its wild values drawn in: of neighbours that agree by ρ only what is new in each
    counts, so that n of them are worth n·(1 − ρ)/(1 + ρ) white ones. ρ is estimated, too: the p-value is the mean over what it
    may be
    (:func:`~inertial.population.memory.memories_of`). σ is that of the differences of neighbours, by their median, so that
    neither changes nor single outliers widen it.

    Parameters
    ----------
    level : largest p-value of a change that is reported.
    """
    noise = _Noise.of(values)
    left, skipped = noise.left, values.size - noise.left.size
    if left.size < 2 * FEWEST or not noise.sigma > 0.0:
        return []
    cuts = sorted(_segment(left, (0, left.size), noise, level))
    out: list[ChangePoint] = []
    for low, cut, high in zip([0, *cuts], cuts, [*cuts[1:], left.size], strict=False):
        offset = _best(left[low:high])
        out.append(_described(left[low:high], low + skipped, cut - low if offset is None else offset, noise))
    return out


@dataclass(frozen=True)
class _Noise:
    """Noise of a series.

    left : innovations of the series, (m,), with its level; sigma : their standard deviation
    wider : (25,), what the mean of innovations scatters by over what it would if the correlation found were the true one
    """

    left: Array
    sigma: float
    wider: Array

    @classmethod
    def of(cls, values: Array) -> "_Noise":
        plain = drawn_in(values)
        memory = memory_of(plain)
        left = drawn_in(innovations(values, memory))
        # a mean of the series scatters as 1/(1 − ρ), and its innovations here are divided by 1 − ρ of the estimate
        return cls(left, noise_of(left), (1.0 - memory) / (1.0 - memories_of(plain)))


def noise_of(values: Array) -> float:
    """σ of the noise of a series whose level may change: of the differences of neighbours, the wildest drawn in to four σ.

    The median alone would be too small where the noise itself is of two kinds.
    """
    if values.size < 3:
        return 0.0
    steps = np.diff(values)
    middle = float(np.median(np.abs(steps))) / NORMAL_MEDIAN
    drawn_in = float(np.sqrt(np.mean(np.clip(steps, -DRAWN_IN * middle, DRAWN_IN * middle) ** 2)))
    return max(middle, drawn_in) / np.sqrt(2.0)


def _segment(values: Array, ends: tuple[int, int], noise: _Noise, level: float) -> list[int]:
    start, stop = ends
    part = values[start:stop]
    cut = _best(part)
    if cut is None or not _p_value(_statistic(part)[cut - 1] / noise.sigma, part.size, noise) <= level:
        return []
    split = start + cut
    return [split, *_segment(values, (start, split), noise, level), *_segment(values, (split, stop), noise, level)]


def _statistic(values: Array) -> Array:
    """|difference of means| over its standard error, σ = 1, for a change before point 1 … n−1; (n−1,)."""
    n = values.size
    k = np.arange(1, n)
    before = np.cumsum(values)[:-1]
    difference = (values.sum() - before) / (n - k) - before / k
    return np.abs(difference) * np.sqrt(k * (n - k) / n)


def _best(values: Array) -> int | None:
    """The most likely first point of a new level; None where the series is too short."""
    if values.size < 2 * FEWEST:
        return None
    allowed = _statistic(values)[FEWEST - 1 : values.size - FEWEST]
    return int(np.argmax(allowed)) + FEWEST


def _p_value(statistic: float, n: int, noise: _Noise) -> float:
    """Of a statistic in n values; σ comes from the differences of the whole series."""
    dof = max(DOF_OF_DIFFERENCES * (noise.left.size - 1), 1.0)
    chance = float(np.mean(2.0 * student.sf(statistic / noise.wider, dof)))
    return min(1.0, PLACES * n**GROWTH * chance)


def _described(values: Array, offset: int, cut: int, noise: _Noise) -> ChangePoint:
    """The change before the value number ``cut`` of a part of a series, which begins at ``offset`` in it."""
    statistic = _statistic(values) / noise.sigma
    best = statistic[cut - 1]
    likely = np.flatnonzero(best**2 - statistic**2 <= LIKELY) + 1
    n = values.size
    shift = float(values[cut:].mean() - values[:cut].mean())
    error = float(noise.sigma * np.sqrt(1.0 / cut + 1.0 / (n - cut)))
    low, high = int(likely.min()), int(likely.max())
    return ChangePoint(offset + cut, offset + low, offset + high, shift, error, _p_value(float(best), n, noise))
