"""Control charts of single values: Shewhart with the Western Electric rules, and the exponentially weighted moving average."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import lfilter

from inertial.arrays import Array, Flags, Index
from inertial.population.memory import MOST, drawn_in, memories_of, memory_of, tail_of

D2_OF_TWO = 1.128  # mean range of two normal values over their σ (NIST/SEMATECH e-Handbook 6.3.2.2)
RULES = (
    "one point beyond 3σ",
    "two of three points beyond 2σ on one side",
    "four of five points beyond 1σ on one side",
    "eight points in a row on one side",
)
CHARTS_SIMULATED = 6000
IN_THE_TAIL = 0.02  # share of the simulated charts that the tail is known from
SURELY_BELOW = 0.8
"""A chart is judged by the correlation below which that of the series lies with this probability. Simulated with 0.75, 0.85 and
0.92 (500 series in control with ρ = 0.6; 40, 100 and 150 points): at most 1.4 % have p < 0.01. With 0.8: at most 1.0 % (10, 20
and 40 points of the baseline)."""
EWMA_WEIGHT, EWMA_WIDTH = 0.2, 2.962


@dataclass(frozen=True)
class Baseline:
    """Centre line and σ of a chart, in the values' unit."""

    centre: float
    sigma: float


def baseline(values: Array, first: int | None = None) -> Baseline:
    """Centre and σ of individual values (n,), σ from the mean moving range of two (e-Handbook 6.3.2.2).

    Parameters
    ----------
    first : points that make the centre, all where None; σ always comes from the ranges of all, which a moved level hardly widens
    """
    return Baseline(float(np.mean(values[:first])), float(np.mean(np.abs(np.diff(values)))) / D2_OF_TWO)


def signals(values: Array, chart: Baseline) -> "tuple[Flags, Ewma]":
    """Signals of the four rules, (4, n), and the moving average."""
    return western_electric(values, chart), ewma(values, chart)


def alarms(rules: Flags, moving: Flags, counted: Flags) -> int:
    """Number of alarms among the points that count: signals of the rules, and points whose moving average is outside.

    A level that stays moved goes on giving alarms, so their number tells it from single ones.
    """
    return int(np.count_nonzero(rules.any(axis=0) & counted) + np.count_nonzero(moving & counted))


@dataclass(frozen=True)
class FalseAlarms:
    """How many alarms charts in control give: their mean, and of simulated charts the sorted numbers (charts,)."""

    mean: float
    numbers: Index

    def p_value(self, number: int) -> float:
        """Probability of as many alarms by chance: the share of simulated charts, beyond their 98 % with a geometric tail.

        The tail is longer than two moments tell: a centre that is known from few points and is off goes on giving alarms.
        """
        edge = int(np.quantile(self.numbers, 1.0 - IN_THE_TAIL, method="higher"))
        beyond = self.numbers[self.numbers >= max(edge, 1)]
        if number <= max(edge, 1) or not beyond.size:
            return float(np.mean(self.numbers >= number)) if number else 1.0
        excess = float(np.mean(beyond - max(edge, 1))) + 1.0 / beyond.size
        return float(beyond.size / self.numbers.size * (excess / (1.0 + excess)) ** (number - max(edge, 1)))


def chance_of_alarms(values: Array, first: int, counted: int) -> FalseAlarms:
    """What the alarms of a series (n,) are held against: charts in control whose points are as correlated and as heavy-tailed.

    The correlation of neighbours is known from the series alone; taken is what it stays below with a probability of 0.8.

    Parameters
    ----------
    first : points that make the centre; counted : the last so many count
    """
    plain = drawn_in(values)
    memory = min(round(float(np.quantile(memories_of(plain), SURELY_BELOW)), 1), MOST)
    return false_alarms(values.size, first, counted, memory, float(tail_of(values, memory_of(plain))))


@cache
def false_alarms(n: int, first: int, counted: int, memory: float = 0.0, tail: float = np.inf) -> FalseAlarms:
    """The alarms of charts in control, whose centre is known from their first points only.

    Parameters
    ----------
    n : points; first : of them, that make the centre; counted : the last so many count
    memory : correlation of neighbours; tail : degrees of freedom of Student's innovations, infinite for normal ones
    """
    code = [n, first, counted, round(100.0 * memory), 0 if np.isinf(tail) else round(tail)]
    rng = np.random.default_rng(np.random.SeedSequence(code[:3] if code[3:] == [0, 0] else code))
    counts: list[Index] = []
    for _ in range(10):
        values = _in_control(rng, (CHARTS_SIMULATED // 10, n), memory, tail)
        sigma = np.mean(np.abs(np.diff(values)), axis=-1, keepdims=True) / D2_OF_TWO
        rules, moving = signals((values - values[:, :first].mean(axis=-1, keepdims=True)) / sigma, Baseline(0.0, 1.0))
        signalled, outside = np.any(rules, axis=0)[..., n - counted :], moving.outside[..., n - counted :]
        counts.append(np.count_nonzero(signalled, axis=-1) + np.count_nonzero(outside, axis=-1))
    numbers = np.sort(np.concatenate(counts)).astype(np.int64)
    return FalseAlarms(float(np.mean(numbers)), numbers)


def _in_control(rng: np.random.Generator, shape: tuple[int, int], memory: float, tail: float) -> Array:
    """Series (charts, n) of a process whose level stands still."""
    if memory == 0.0 and np.isinf(tail):
        return rng.standard_normal(shape)
    before = 50 if memory else 0
    size = (shape[0], shape[1] + before)
    drive = rng.standard_normal(size) if np.isinf(tail) else rng.standard_t(tail, size)
    return np.asarray(lfilter([1.0], [1.0, -memory], drive, axis=-1), dtype=float)[:, before:]


def western_electric(values: Array, chart: Baseline) -> Flags:
    """Which of the four rules every point of values (..., n) completes, (4, ..., n) (Western Electric 1956, p. 25)."""
    z = (values - chart.centre) / chart.sigma
    return np.stack(
        [
            np.abs(z) > 3.0,
            _run(z > 2.0, 2, 3) | _run(z < -2.0, 2, 3),
            _run(z > 1.0, 4, 5) | _run(z < -1.0, 4, 5),
            _run(z > 0.0, 8, 8) | _run(z < 0.0, 8, 8),
        ]
    )


def _run(beyond: Flags, needed: int, window: int) -> Flags:
    """Where the point itself is beyond and so many of the last ``window`` are, (..., n)."""
    counts = np.cumsum(beyond, axis=-1, dtype=np.int64)
    counts[..., window:] = counts[..., window:] - counts[..., :-window]
    return beyond & (counts >= needed)


@dataclass(frozen=True)
class Ewma:
    """The moving average of every point (..., n), half the width of its limits (n,), and where it is outside (..., n)."""

    average: Array
    half_width: Array
    outside: Flags


def ewma(values: Array, chart: Baseline, weight: float = EWMA_WEIGHT, width: float = EWMA_WIDTH) -> Ewma:
    """The chart of the exponentially weighted moving average with its exact limits (e-Handbook 6.3.2.4).

    Parameters
    ----------
    weight : of the newest point, λ; width : of the limits in σ of the average, L.
    """
    start = np.full((*values.shape[:-1], 1), (1.0 - weight) * chart.centre)
    path, _ = lfilter([weight], [1.0, weight - 1.0], values, zi=start)
    average = np.asarray(path, dtype=float)
    n = np.arange(1, values.shape[-1] + 1)
    spread = chart.sigma * np.sqrt(weight / (2.0 - weight) * (1.0 - (1.0 - weight) ** (2 * n)))
    return Ewma(average, width * spread, np.abs(average - chart.centre) > width * spread)
