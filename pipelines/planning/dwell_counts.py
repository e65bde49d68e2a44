"""Number of dwells per soak of a plan design: the fewest that meet a requirement."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import permutations

import numpy as np

from inertial.arrays import Array
from pipelines.planning.timed_design import PlanDesign, TimedDesign

FEWEST = 4
"""Minimum number of dwells of a soak: the reference pose at both ends, and two other poses between."""

MOST = 420
"""Maximum number of dwells of a recipe: above it the search time grows faster than the gain."""

_FIRST = 3
"""The first reduction removes one part in this many of a soak's dwells."""


def fewest_dwells(timed: TimedDesign, design: PlanDesign, allowed: Array) -> PlanDesign | None:
    """The design with the fewest dwells whose starting arrangement stays within the allowed ratios; None where there is none.

    Parameters
    ----------
    design : soaks and dwell length; its counts are replaced
    allowed : (3, p) or (pairs,), largest ratio to the required errors, as returned by :meth:`TimedDesign.ratio_and_seconds`;
        above 1 where an exchange of poses is expected to improve it
    """

    def worst_ratio(counts: tuple[int, ...]) -> float:
        return float(np.max(timed.ratio_and_seconds(replace(design, counts=counts))[0] / allowed))

    soaks = len(design.order)
    uniform = smallest_passing(lambda n: worst_ratio((n,) * soaks) <= 1.0, FEWEST, MOST // soaks)
    if uniform is None:
        return None
    counts, step = (uniform,) * soaks, max(1, uniform // _FIRST)
    while step >= 1:
        fewer = _fewer(counts, step, worst_ratio)
        counts, step = (counts, step // 2) if fewer is None else (fewer, step)
    return replace(design, counts=counts)


def _fewer(
    counts: tuple[int, ...], step: int, worst_ratio: Callable[[tuple[int, ...]], float]
) -> tuple[int, ...] | None:
    """Counts with a smaller sum that still meet the ratios; None where neither a reduction nor a shift does."""
    for variants in (_reduced(counts, step), _shifted(counts, step)):
        passing = [(ratio, variant) for variant in variants if (ratio := worst_ratio(variant)) <= 1.0]
        if passing:
            return min(passing)[1]
    return None


def _reduced(counts: tuple[int, ...], step: int) -> Iterator[tuple[int, ...]]:
    """Counts with ``step`` dwells removed from one soak."""
    for k, n in enumerate(counts):
        if n - step >= FEWEST:
            yield (*counts[:k], n - step, *counts[k + 1 :])


def _shifted(counts: tuple[int, ...], step: int) -> Iterator[tuple[int, ...]]:
    """Counts with ``2·step`` dwells removed from one soak and ``step`` added to another."""
    for source, target in permutations(range(len(counts)), 2):
        if counts[source] - 2 * step >= FEWEST:
            variant = list(counts)
            variant[source] -= 2 * step
            variant[target] += step
            yield tuple(variant)


def smallest_passing(passes: Callable[[int], bool], low: int, high: int) -> int | None:
    """The smallest number from low to high that passes, by bisection; None where ``high`` fails.

    Every number above one that passes must pass, too.
    """
    if not passes(high):
        return None
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if passes(middle) else (middle + 1, high)
    return high
