"""How many dwells each soak of a design needs: as few as fulfil a wish, more where they bring more."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from pipelines.planning.layout import PlanDesign, TimedDesign

    Array = NDArray[np.float64]

FEWEST = 4
"""Dwells of a soak: the reference pose at both ends, and others between."""

MOST = 420
"""Dwells in all: more take longer to arrange than they gain."""

_FIRST = 3
"""Part of a soak's dwells that is taken away at first."""


def fewest_dwells(layout: TimedDesign, made: PlanDesign, allowed: Array) -> PlanDesign | None:
    """The design with the fewest dwells whose plain arrangement lacks no more of the wish than is allowed.

    Parameters
    ----------
    made : its soaks and the length of its dwells; the counts are found
    allowed : as :meth:`Layout.shortfall`'s, what an exchange of poses will mend
    """

    def lack(counts: tuple[int, ...]) -> float:
        return float(np.max(layout.shortfall(replace(made, counts=counts))[0] / allowed))

    soaks = len(made.order)
    alike = least(lambda n: lack((n,) * soaks) <= 1.0, FEWEST, MOST // soaks)
    if alike is None:
        return None
    counts, step = (alike,) * soaks, max(1, alike // _FIRST)
    while step >= 1:
        fewer = _fewer(counts, step, lack)
        counts, step = (counts, step // 2) if fewer is None else (fewer, step)
    return replace(made, counts=counts)


def _fewer(counts: tuple[int, ...], step: int, lack: Callable[[tuple[int, ...]], float]) -> tuple[int, ...] | None:
    """Fewer dwells that still do: of one soak, or twice as many fewer of one as there are more of another."""
    for tried in (_taken(counts, step), _moved(counts, step)):
        found = [(value, new) for new in tried if (value := lack(new)) <= 1.0]
        if found:
            return min(found)[1]
    return None


def _taken(counts: tuple[int, ...], step: int) -> Iterator[tuple[int, ...]]:
    for k, n in enumerate(counts):
        if n - step >= FEWEST:
            yield (*counts[:k], n - step, *counts[k + 1 :])


def _moved(counts: tuple[int, ...], step: int) -> Iterator[tuple[int, ...]]:
    for here, there in permutations(range(len(counts)), 2):
        if counts[here] - 2 * step >= FEWEST:
            new = list(counts)
            new[here] -= 2 * step
            new[there] += step
            yield tuple(new)


def least(good: Callable[[int], bool], low: int, high: int) -> int | None:
    """The least number from low to high that is good, where all above a good one are; None where none is."""
    if not good(high):
        return None
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if good(middle) else (middle + 1, high)
    return high
