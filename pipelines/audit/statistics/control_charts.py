"""Control charts of single values: Shewhart with the Western Electric rules, and the exponentially weighted moving average."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter
from scipy.stats import nbinom, poisson

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]

D2_OF_TWO = 1.128  # mean range of two normal values over their σ (NIST/SEMATECH e-Handbook 6.3.2.2)
RULES = (
    "one point beyond 3σ",
    "two of three points beyond 2σ on one side",
    "four of five points beyond 1σ on one side",
    "eight points in a row on one side",
)
IN_CONTROL_RUN_LENGTH = (
    91.75  # points between false signals of the four rules together (Champ and Woodall 1987, table 1)
)
CHARTS_SIMULATED = 300
EWMA_WEIGHT, EWMA_WIDTH = 0.2, 2.962
EWMA_RUN_LENGTH = 500.0  # of these two (Lucas and Saccucci 1990; Montgomery, table 9.11)


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


def signals(values: Array, chart: Baseline) -> tuple[Flags, Ewma]:
    """Signals of the four rules, (4, n), and the moving average."""
    return western_electric(values, chart), ewma(values, chart)


def alarms(rules: Flags, moving: Flags, counted: Flags) -> int:
    """Number of alarms among the points that count: signals of the rules, and points whose moving average is outside.

    A level that stays moved goes on giving alarms, so their number tells it from single ones.
    """
    return int(np.count_nonzero(rules.any(axis=0) & counted) + np.count_nonzero(moving & counted))


@cache
def false_alarms(n: int, first: int, counted: int) -> tuple[float, float]:
    """Mean and variance of the number of alarms of a chart in control, whose centre is known from its first points only.

    Parameters
    ----------
    n : points; first : of them, that make the centre; counted : the last so many count
    """
    rng = np.random.default_rng(np.random.SeedSequence([n, first, counted]))
    which = np.arange(n) >= n - counted
    found = []
    for values in rng.standard_normal((CHARTS_SIMULATED, n)):
        rules, moving = signals(values, baseline(values, first))
        found.append(alarms(rules, moving.outside, which))
    return float(np.mean(found)), float(np.var(found, ddof=1))


def p_of_alarms(number: int, mean: float, variance: float) -> float:
    """Probability of as many alarms by chance: negative binomial with the moments given, Poisson where it is no wider."""
    if number == 0:
        return 1.0
    if variance <= mean:
        return float(poisson.sf(number - 1, mean))
    return float(nbinom.sf(number - 1, mean**2 / (variance - mean), mean / variance))


def western_electric(values: Array, chart: Baseline) -> Flags:
    """Which of the four rules every point completes, (4, n) (Western Electric 1956, p. 25; e-Handbook 6.3.2)."""
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
    """Where the point itself is beyond and so many of the last ``window`` are, (n,)."""
    counts = np.convolve(beyond.astype(int), np.ones(window, dtype=int))[: beyond.size]
    return beyond & (counts >= needed)


@dataclass(frozen=True)
class Ewma:
    """The moving average of every point, half the width of its limits, and where it is outside; (n,) each."""

    average: Array
    half_width: Array
    outside: Flags


def ewma(values: Array, chart: Baseline, weight: float = EWMA_WEIGHT, width: float = EWMA_WIDTH) -> Ewma:
    """The chart of the exponentially weighted moving average with its exact limits (e-Handbook 6.3.2.4).

    Parameters
    ----------
    weight : of the newest point, λ; width : of the limits in σ of the average, L.
    """
    path, _ = lfilter([weight], [1.0, weight - 1.0], values, zi=np.array([(1.0 - weight) * chart.centre]))
    average = np.asarray(path, dtype=float)
    n = np.arange(1, values.size + 1)
    spread = chart.sigma * np.sqrt(weight / (2.0 - weight) * (1.0 - (1.0 - weight) ** (2 * n)))
    return Ewma(average, width * spread, np.abs(average - chart.centre) > width * spread)
