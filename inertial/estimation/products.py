"""Products of columns with each other in the whitened space, for each value of their nonlinear parameters."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from inertial.estimation.candidate import Candidate
from inertial.estimation.whitener import Whitener

Array = NDArray[np.float64]
Groups = Iterable[tuple[NDArray[np.intp], Whitener]]
"""Places of the blocks that share a whitener, and it."""

PIECE = 1_000_000
"""Largest number of columns' values that are whitened at a time for their products."""


def products_of(candidate: Candidate, level: Array, groups: Groups) -> Array:
    """Products cᵀV⁻¹c (b, grid, p, p) of a candidate's columns; rows that blocks share are whitened once.

    Parameters
    ----------
    level : (b,), typical white standard error of each block, g
    """
    columns = candidate.columns
    count, _, grid, p = columns.shape
    row_of = np.arange(count) if candidate.rows is None else candidate.rows
    out = np.empty((level.size, grid, p, p))
    for own, whitener in groups:
        rows, back = np.unique(row_of[own], return_inverse=True)
        few = max(PIECE // columns[0].size, 1)
        parts = np.split(rows, range(few, rows.size, few))
        out[own] = np.concatenate([_squares(columns[some], whitener) for some in parts])[back]
    return out / level[:, None, None, None] ** 2


def _squares(columns: Array, whitener: Whitener) -> Array:
    """Products (rows, grid, p, p) of columns (rows, n, grid, p) with each other after whitening."""
    rows, n, grid, p = columns.shape
    white = whitener.rows(columns.transpose(0, 2, 3, 1).reshape(rows * grid, p, n))
    return (white @ np.swapaxes(white, -1, -2)).reshape(rows, grid, p, p)
