"""Products of columns with each other in the whitened space, for each value of their nonlinear parameters."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.candidate import Candidate, times_rows
from inertial.criticism.whitener import applied, applied_back

Array = NDArray[np.float64]

PIECE = 1_000_000
"""Largest number of columns' values that are whitened at a time for their products."""


def products_of(
    candidate: Candidate, level: Array, groups: Iterable[tuple[NDArray[np.intp], Array | None, Array]]
) -> Array:
    """Products cᵀV⁻¹c (b, grid, p, p) of a candidate's columns; rows that blocks share are whitened once.

    Parameters
    ----------
    level : (b,), typical white standard error of each block, g
    groups : places of the blocks that share a whitener, and it: (n, n), or if that is None by dwell (n,)
    """
    columns = candidate.columns
    count, _, grid, p = columns.shape
    row_of = np.arange(count) if candidate.rows is None else candidate.rows
    out = np.empty((level.size, grid, p, p))
    for own, whitener, white in groups:
        rows, back = np.unique(row_of[own], return_inverse=True)
        few = max(PIECE // columns[0].size, 1)
        parts = np.split(rows, range(few, rows.size, few))
        out[own] = np.concatenate([_squares(columns[some], whitener, white) for some in parts])[back]
    return out / level[:, None, None, None] ** 2


def products_with(
    candidate: Candidate,
    rows: Array,
    level: Array,
    groups: Iterable[tuple[NDArray[np.intp], Array | None, Array]],
) -> tuple[Array, Array]:
    """Products cᵀV⁻¹c (blocks, p, p) of a candidate's columns at one value, and those with rows in g: (blocks, p, k).

    Parameters
    ----------
    rows : (blocks, k, n); level, groups : as of :func:`products_of`, of all blocks
    """
    count, p = level.size, candidate.columns.shape[-1]
    row_of = np.arange(count) if candidate.rows is None else candidate.rows
    own, across = np.empty((count, p, p)), np.empty((count, p, rows.shape[1]))
    for members, whitener, white in groups:
        few, place = np.unique(row_of[members], return_inverse=True)
        columns = np.swapaxes(candidate.columns[few, :, 0], -1, -2)
        made = columns * white if whitener is None else applied(whitener, columns)
        own[members] = (made @ np.swapaxes(made, -1, -2))[place]
        back = made * white if whitener is None else applied_back(whitener, made)
        solved = Candidate(
            np.swapaxes(back, -1, -2)[:, :, None], shared=False, rows=None if few.size == members.size else place
        )
        across[members] = times_rows(rows if members.size == count else rows[members], solved)[:, 0]
    scale = level[:, None, None] ** 2
    return own / scale, across / scale


def _squares(columns: Array, whitener: Array | None, white: Array) -> Array:
    """Products (rows, grid, p, p) of columns (rows, n, grid, p) with each other after a whitener (n, n), or one by dwell (n,)."""
    rows, n, grid, p = columns.shape
    own = columns.transpose(0, 2, 3, 1).reshape(rows * grid, p, n)
    white = own * white if whitener is None else applied(whitener, own)
    return (white @ np.swapaxes(white, -1, -2)).reshape(rows, grid, p, p)
