"""Samples that come in tables: a record in one, a long one in several; and what is kept of those that have gone by."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from numpy.typing import NDArray

STATIC = "allan"


def by_record(samples: Iterable[pd.DataFrame]) -> Iterator[tuple[int, Iterator[pd.DataFrame]]]:
    """Number and tables of every record that has samples, each as long as it takes: not all of them lie in memory."""
    yield from groupby((table for table in samples if len(table)), key=lambda t: int(t["record"].iloc[0]))


def dwells_whole(samples: Iterable[pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """One table for every record but the static ones."""
    for _, tables in by_record(samples):
        kept = [table for table in tables if table["kind"].iloc[0] != STATIC]
        if kept:
            yield kept[0] if len(kept) == 1 else pd.concat(kept, ignore_index=True)


@dataclass
class Signal:
    """What is left of one unit's samples in one record: how many there were, where they lay, and what was wrong with them.

    ``wild`` is the first value that is not finite, with its axis and row; ``clipped`` counts values at full scale, by axis.
    """

    zero: float
    full: float
    n: int = 0
    low: NDArray[np.float64] = field(default_factory=lambda: np.full(3, np.inf))
    high: NDArray[np.float64] = field(default_factory=lambda: np.full(3, -np.inf))
    wild: tuple[float, int, int] | None = None
    wild_count: int = 0
    clipped: int = 0
    clipped_axis: int = 0

    def add(self, values: NDArray[np.float64]) -> None:
        """Takes note of samples (n, 3) that follow those before."""
        if not len(values):
            return
        bad = np.argwhere(~np.isfinite(values))
        if len(bad) and self.wild is None:
            row, axis = bad[0].tolist()
            self.wild = (float(values[row, axis]), axis, self.n + row)
        self.wild_count += len(bad)
        ends = np.argwhere(np.abs(values - self.zero) >= self.full) if self.full > 0.0 else bad[:0]
        if len(ends) and not self.clipped:
            self.clipped_axis = int(ends[0][1])
        self.clipped += len(ends)
        self.low, self.high = np.minimum(self.low, values.min(axis=0)), np.maximum(self.high, values.max(axis=0))
        self.n += len(values)
