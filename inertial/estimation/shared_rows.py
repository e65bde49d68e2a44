"""Rows of columns that several blocks have in common, which are stored and whitened once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def shared_rows(columns: Array, *, radial: bool) -> NDArray[np.intp] | None:
    """The row of each block where columns (blocks, ...) are equal: of all blocks, by axis, or in each unit; else None.

    Parameters
    ----------
    radial : whether a block is a unit; otherwise it is an axis of one
    """
    blocks = len(columns)
    if radial:
        return np.zeros(blocks, dtype=np.intp) if np.all(columns == columns[:1]) else None
    by_unit = columns.reshape(-1, 3, *columns.shape[1:])
    # most candidates differ in a few values already
    axes = np.array_equal(by_unit[-1, 0, -1], by_unit[-1, 2, -1]) and bool(np.all(by_unit == by_unit[:, :1]))
    units = len(by_unit) > 1 and np.array_equal(by_unit[-1, :, -1], by_unit[0, :, -1])
    units = units and bool(np.all(by_unit == by_unit[:1]))
    if not axes and not units:
        return None
    place = np.arange(blocks)
    unit, axis = (0 if units else place // 3), (0 if axes else place % 3)
    return unit * (1 if axes else 3) + axis + np.zeros(blocks, dtype=np.intp)


def finest_rows(rows_of: Sequence[NDArray[np.intp] | None], *, radial: bool) -> NDArray[np.intp] | None:
    """The rows of blocks for the columns of several values: where they differ at one, they differ."""
    known = [rows for rows in rows_of if rows is not None]
    if len(known) < len(rows_of):
        return None
    finest = max(known, key=lambda rows: int(rows.max()))
    by_unit = not radial and finest.size > 3 and any(rows[0] != rows[3] for rows in known)
    by_axis = not radial and any(rows[0] != rows[1] for rows in known)
    return None if by_unit and by_axis else finest
