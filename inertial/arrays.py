"""Types of arrays by what their elements are, where flags stand in a row, and σ by medians."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Flags = NDArray[np.bool_]
Index = NDArray[np.int64]
Places = NDArray[np.intp]
Texts = NDArray[np.object_]

NORMAL_MEDIAN = 0.6744897501960817
"""Median of the magnitude of a standard normal value: σ is the median absolute deviation over it (Hampel 1974)."""


def runs_of(inside: Flags) -> tuple[Index, Index]:
    """Starts and ends (one past the last) of the stretches of True."""
    steps = np.diff(np.concatenate([[0], inside.astype(np.int8), [0]]))
    return np.flatnonzero(steps == 1).astype(np.int64), np.flatnonzero(steps == -1).astype(np.int64)


def levels_apart(values: Array, width: float) -> int:
    """Levels of a width that hold values (n,), however densely they lie: each begins at the first value beyond the last one."""
    count, begin = 0, -np.inf
    for value in np.sort(values).tolist():
        if value - begin >= width:
            count, begin = count + 1, value
    return count


def over(values: Array | float, weights: Array) -> Array:
    """Values divided by weights; zero where a weight is zero."""
    there = weights > 0.0
    return np.where(there, values / np.where(there, weights, 1.0), 0.0)
