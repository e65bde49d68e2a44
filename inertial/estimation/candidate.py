"""Columns of an effect as a candidate for a model, rows times them, and the rows that several blocks have in common."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Places


@dataclass(frozen=True)
class Candidate:
    """Columns of an effect at one or more values of its nonlinear parameters.

    columns : (rows, n, grid, p), g per unit of the coefficient
    shared : whether all blocks share the p coefficients
    rows : (blocks,), the row of each block, every row for as many blocks; None where each block has a row of its own
    units : the units that the columns are of, each with coefficients of its own for its three axes; those of the others are zero.
        All units if None. Only where shared
    key : under which products of the columns are stored; not stored if None
    """

    columns: Array
    shared: bool
    rows: Places | None = None
    units: Places | None = None
    key: object = None
    per_unit: int = 3

    @property
    def of_blocks(self) -> Array:
        """The columns of each block, (blocks, n, grid, p)."""
        return self.columns if self.rows is None else self.columns[self.rows]

    @property
    def blocks(self) -> Places | None:
        """The blocks of the units that the columns are of; None for all."""
        return None if self.units is None else blocks_of_units(self.units, self.per_unit)


def blocks_of_units(units: Places, per_unit: int) -> Places:
    """The blocks of some units, (units · axes,)."""
    return (per_unit * units[:, None] + np.arange(per_unit)).reshape(-1)


def times_rows(rows: Array, candidate: Candidate) -> Array:
    """Rows (blocks, k, n) times the columns of a candidate, (b, grid, p, k)."""
    if candidate.blocks is not None:
        rows = rows[candidate.blocks]
    count, n, grid, p = candidate.columns.shape
    blocks, k = rows.shape[:2]
    flat = candidate.columns.reshape(count, n, grid * p)
    if candidate.rows is None:
        product = rows @ flat
    elif blocks != count * int(np.bincount(candidate.rows, minlength=count).min()):
        # some blocks of a row are missing: they have a whitener of their own
        product = rows @ flat[candidate.rows]
    else:
        # the blocks of each row beside each other: one product of matrices for all of them
        order = np.argsort(candidate.rows, kind="stable")
        sorted_ = bool(np.all(order[1:] > order[:-1]))
        product = ((rows if sorted_ else rows[order]).reshape(count, -1, n) @ flat).reshape(blocks, k, grid * p)
        if not sorted_:
            product = product[np.argsort(order)]
    return np.swapaxes(product, -1, -2).reshape(blocks, grid, p, k)


def shared_rows(columns: Array, per_unit: int) -> Places | None:
    """The row of each block where columns (blocks, ...) are equal: of all blocks, by axis, or in each unit; else None.

    Parameters
    ----------
    per_unit : blocks of a unit: one for each axis, or one alone
    """
    blocks = len(columns)
    if per_unit == 1:
        return np.zeros(blocks, dtype=np.intp) if np.all(columns == columns[:1]) else None
    by_unit = columns.reshape(-1, per_unit, *columns.shape[1:])
    # most candidates differ in a few values already
    axes = np.array_equal(by_unit[-1, 0, -1], by_unit[-1, -1, -1]) and bool(np.all(by_unit == by_unit[:, :1]))
    units = len(by_unit) > 1 and np.array_equal(by_unit[-1, :, -1], by_unit[0, :, -1])
    units = units and bool(np.all(by_unit == by_unit[:1]))
    if not axes and not units:
        return None
    block = np.arange(blocks)
    unit, axis = (0 if units else block // per_unit), (0 if axes else block % per_unit)
    return unit * (1 if axes else per_unit) + axis + np.zeros(blocks, dtype=np.intp)


def finest_rows(rows_of: Sequence[Places | None], per_unit: int) -> Places | None:
    """The rows of blocks for the columns of several values: where they differ at one, they differ."""
    known = [rows for rows in rows_of if rows is not None]
    if len(known) < len(rows_of):
        return None
    finest = max(known, key=lambda rows: int(rows.max()))
    by_unit = per_unit > 1 and finest.size > per_unit and any(rows[0] != rows[per_unit] for rows in known)
    by_axis = per_unit > 1 and any(rows[0] != rows[1] for rows in known)
    return None if by_unit and by_axis else finest
