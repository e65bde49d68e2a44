"""Changes of level in a series: when, how much, and between which points they may lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import t as student

from inertial.population.memory import drawn_in, memory_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FEWEST = 4  # points on either side
LIKELY = 7.35  # −2·ln(1 − √0.95): twice the log-likelihood within which the place lies with 95 % (Hansen 2000, table 1)
DRAWN_IN = 4.0
DOF_OF_DIFFERENCES = (
    2.0 / 3.0
)  # degrees of freedom per difference of neighbours (von Neumann 1941, Ann. Math. Stat. 12, 367)
TO_SIGMA = 1.4826  # σ over the median absolute deviation of a normal value


@dataclass(frozen=True)
class ChangePoint:
    """One change of level.

    first : index of the first point after it; low, high : earliest and latest that ``first`` may be, 95 %
    shift, error : level after minus level before and its standard error, the values' unit
    p_value : that noise of this length, as correlated as the series itself, shows as large a change anywhere (Bonferroni over the
        places), σ known as from the series' own differences
    """

    first: int
    low: int
    high: int
    shift: float
    error: float
    p_value: float


def change_points(values: Array, level: float = 1e-3) -> list[ChangePoint]:
    """The changes of level of a series (n,), found by binary segmentation, each then placed between its neighbours.

    σ is that of the differences of neighbours, by their median, so that neither changes nor single outliers widen it. A
    series whose
    neighbours agree by ρ has means that scatter √((1 + ρ)/(1 − ρ)) more than white ones, and is worth (1 − ρ)/(1 + ρ) of its
    points; wild values are drawn in first. White noise assumed, a series of ρ = 0.6 had a "change" in six of ten cases.

    Parameters
    ----------
    level : largest p-value of a change that is reported.
    """
    n, values = values.size, drawn_in(values)
    noise = _Noise.of(values)
    if n < 2 * FEWEST or not noise.sigma > 0.0:
        return []
    places = sorted(_segment(values, (0, n), noise, level))
    out: list[ChangePoint] = []
    for number, place in enumerate(places):
        low = places[number - 1] if number else 0
        high = places[number + 1] if number + 1 < len(places) else n
        found = _best(values[low:high])
        if found is not None:
            out.append(_described(values[low:high], low, found, noise))
        else:
            out.append(_described(values[low:high], low, place - low, noise))
    return out


@dataclass(frozen=True)
class _Noise:
    """Noise of a series.

    sigma : what means of its values scatter by as if it were white; worth : independent points that it is worth
    """

    sigma: float
    worth: float

    @classmethod
    def of(cls, values: Array) -> _Noise:
        memory = memory_of(values)
        # differences of neighbours have the variance 2·σ²·(1 − ρ)
        own = noise_of(values) / np.sqrt(1.0 - memory)
        stretch = (1.0 + memory) / (1.0 - memory)
        return cls(float(own * np.sqrt(stretch)), values.size / stretch)


def noise_of(values: Array) -> float:
    """σ of the noise of a series whose level may change: of the differences of neighbours, the wildest drawn in to four σ.

    The median alone would be too small where the noise itself is of two kinds.
    """
    if values.size < 3:
        return 0.0
    steps = np.diff(values)
    middle = TO_SIGMA * float(np.median(np.abs(steps)))
    drawn_in = float(np.sqrt(np.mean(np.clip(steps, -DRAWN_IN * middle, DRAWN_IN * middle) ** 2)))
    return max(middle, drawn_in) / np.sqrt(2.0)


def _segment(values: Array, ends: tuple[int, int], noise: _Noise, level: float) -> list[int]:
    start, stop = ends
    place = _best(values[start:stop])
    if place is None:
        return []
    part = values[start:stop]
    if not _p_value(_statistic(part)[place - 1] / noise.sigma, part.size, noise) <= level:
        return []
    split = start + place
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
    places = max(n - 2 * FEWEST + 1, 1)
    return float(min(1.0, 2.0 * student.sf(statistic, max(DOF_OF_DIFFERENCES * (noise.worth - 1.0), 1.0)) * places))


def _described(values: Array, offset: int, place: int, noise: _Noise) -> ChangePoint:
    """The change at a place of a part of a series."""
    statistic = _statistic(values) / noise.sigma
    best = statistic[place - 1]
    likely = np.flatnonzero(best**2 - statistic**2 <= LIKELY) + 1
    n = values.size
    shift = float(values[place:].mean() - values[:place].mean())
    error = float(noise.sigma * np.sqrt(1.0 / place + 1.0 / (n - place)))
    low, high = int(likely.min()), int(likely.max())
    return ChangePoint(offset + place, offset + low, offset + high, shift, error, _p_value(float(best), n, noise))
