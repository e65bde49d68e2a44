"""Columns of an effect as a candidate for a model, rows times them, and the rows that several blocks have in common."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array, Places


@dataclass(frozen=True)
class Candidate:
    """Columns of an effect at one or more values of its nonlinear parameters.

    columns : (rows, n, grid, p), g per unit of the coefficient
    shared : whether all blocks share the p coefficients
    rows : (blocks,), index into ``columns`` for each block, every row used equally often; None: one row per block
    units : indices of the units that the columns belong to, each with its own p coefficients for all its axes; the columns are
        zero in other units. None: all units. Only where ``shared``
    key : key under which products of the columns are stored; None: not stored
    per_unit : number of blocks (axes) of a unit
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

    def at(self, point: int) -> Array:
        """The columns of each block at a point of the grid, (blocks, n, p)."""
        columns = self.columns[:, :, point]
        return columns if self.rows is None else columns[self.rows]

    def pieces(self, most: int) -> Iterator["Candidate"]:
        """The candidate in pieces of at most ``most`` columns, but at least one point of the grid."""
        points, p = self.columns.shape[2:]
        each = max(1, most // p)
        for start in range(0, points, each):
            key = None if self.key is None else (self.key, start, each)
            yield self if each >= points else replace(self, columns=self.columns[:, :, start : start + each], key=key)

    @property
    def blocks(self) -> Places | None:
        """Indices of the blocks of ``units``; None for all blocks."""
        return None if self.units is None else blocks_of_units(self.units, self.per_unit)


def blocks_of_units(units: Places, per_unit: int) -> Places:
    """Indices of the blocks of some units, (units · axes,)."""
    return (per_unit * units[:, None] + np.arange(per_unit)).reshape(-1)


def times_rows(rows: Array, candidate: Candidate) -> Array:
    """Products (b, grid, p, k) of rows (blocks, k, n) and the columns of a candidate; b: its blocks."""
    if candidate.blocks is not None:
        rows = rows[candidate.blocks]
    count, n, grid, p = candidate.columns.shape
    blocks, k = rows.shape[:2]
    flat = candidate.columns.reshape(count, n, grid * p)
    if candidate.rows is None:
        product = rows @ flat
    elif blocks != count * int(np.bincount(candidate.rows, minlength=count).min()):
        # not every block of a row is here: some use another whitener
        product = rows @ flat[candidate.rows]
    else:
        # sorted by row, so that one matrix product serves all blocks of a row
        order = np.argsort(candidate.rows, kind="stable")
        sorted_ = bool(np.all(order[1:] > order[:-1]))
        product = ((rows if sorted_ else rows[order]).reshape(count, -1, n) @ flat).reshape(blocks, k, grid * p)
        if not sorted_:
            product = product[np.argsort(order)]
    return np.swapaxes(product, -1, -2).reshape(blocks, grid, p, k)


def shared_rows(columns: Array, per_unit: int) -> Places | None:
    """Index (blocks,) of the distinct columns of each block; None if no blocks share columns (blocks, ...).

    Columns may be equal in all blocks, in all units on the same axis, or on all axes of a unit.

    Parameters
    ----------
    per_unit : number of blocks of a unit: its axes, or 1 where only the norm is known
    """
    blocks = len(columns)
    if per_unit == 1:
        return np.zeros(blocks, dtype=np.intp) if np.all(columns == columns[:1]) else None
    by_unit = columns.reshape(-1, per_unit, *columns.shape[1:])
    # the last dwell is compared first: it already differs for most candidates
    axes = np.array_equal(by_unit[-1, 0, -1], by_unit[-1, -1, -1]) and bool(np.all(by_unit == by_unit[:, :1]))
    units = len(by_unit) > 1 and np.array_equal(by_unit[-1, :, -1], by_unit[0, :, -1])
    units = units and bool(np.all(by_unit == by_unit[:1]))
    if not axes and not units:
        return None
    block = np.arange(blocks)
    unit, axis = (0 if units else block // per_unit), (0 if axes else block % per_unit)
    return unit * (1 if axes else per_unit) + axis + np.zeros(blocks, dtype=np.intp)


def finest_rows(rows_of: Sequence[Places | None], per_unit: int) -> Places | None:
    """Row indices (blocks,) that suit the columns at all parameter values: blocks share a row only if they do at every value.

    None if each block needs its own row; ``rows_of`` has the indices of :func:`shared_rows` at each value.
    """
    known = [rows for rows in rows_of if rows is not None]
    if len(known) < len(rows_of):
        return None
    finest = max(known, key=lambda rows: int(rows.max()))
    by_unit = per_unit > 1 and finest.size > per_unit and any(rows[0] != rows[per_unit] for rows in known)
    by_axis = per_unit > 1 and any(rows[0] != rows[1] for rows in known)
    return None if by_unit and by_axis else finest
