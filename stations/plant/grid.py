"""Rows at every second of the time of the plant, appended step by step and interpolated linearly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Grid:
    """A table with one row of ``shape`` per step."""

    def __init__(self, first: Array) -> None:
        self._rows = np.zeros((1024, *first.shape))
        self._rows[0] = first
        self.length = 1

    def append(self, row: Array) -> None:
        """Appends the row of the next step."""
        if self.length == len(self._rows):
            self._rows = np.concatenate((self._rows, np.zeros_like(self._rows)))
        self._rows[self.length] = row
        self.length += 1

    @property
    def last(self) -> Array:
        """The newest row."""
        return self._rows[self.length - 1]

    def at(self, steps: Array) -> Array:
        """Rows (n, *shape) at ``steps`` (n,), integer or fractional."""
        left = np.minimum(np.floor(steps).astype(np.int64), self.length - 2)
        part = (steps - left).reshape(-1, *(1,) * (self._rows.ndim - 1))
        return self._rows[left] + part * (self._rows[left + 1] - self._rows[left])
