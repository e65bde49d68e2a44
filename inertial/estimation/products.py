"""Products of columns with each other in the whitened space, for each value of their nonlinear parameters."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from inertial.estimation.candidate import Candidate, times_rows
from inertial.estimation.whitener import Whitener

Array = NDArray[np.float64]
Groups = Iterable[tuple[NDArray[np.intp], Whitener]]
"""Places of the blocks that share a whitener, and it."""

PIECE = 1_000_000
"""Largest number of columns' values that are whitened at a time for their products."""

_MANY, _PART = 32, 3
"""Columns of all blocks from which on the series that span them are found, and how many times fewer than these columns, and than
the dwells, they must be: of large lots products of more series would cost more than whitening."""

_ROUNDING = 1e-13
"""Part of columns of unit length that is rounding."""


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


def products_with(
    candidate: Candidate,
    rows: Array,
    level: Array,
    groups: Groups,
) -> tuple[Array, Array]:
    """Products cᵀV⁻¹c (blocks, p, p) of a candidate's columns at one value, and those with rows in g: (blocks, p, k).

    Parameters
    ----------
    rows : (blocks, k, n); level, groups : as of :func:`products_of`, of all blocks
    """
    count, p = level.size, candidate.columns.shape[-1]
    row_of = np.arange(count) if candidate.rows is None else candidate.rows
    own, across = np.empty((count, p, p)), np.empty((count, p, rows.shape[1]))
    for members, whitener in groups:
        few, place = np.unique(row_of[members], return_inverse=True)
        columns = np.swapaxes(candidate.columns[few, :, 0], -1, -2)
        made = whitener.rows(columns)
        own[members] = (made @ np.swapaxes(made, -1, -2))[place]
        back = whitener.back(made)
        solved = Candidate(
            np.swapaxes(back, -1, -2)[:, :, None], shared=False, rows=None if few.size == members.size else place
        )
        across[members] = times_rows(rows if members.size == count else rows[members], solved)[:, 0]
    scale = level[:, None, None] ** 2
    return own / scale, across / scale


@dataclass(frozen=True)
class Spanned:
    """Columns of many blocks that a few series span: a whitener is applied to these.

    series : (k, n); inside : (blocks, p, k), the columns of each block as combinations of them
    """

    series: Array
    inside: Array

    def products_with(
        self,
        columns: Array,
        places: NDArray[np.intp],
        level: Array,
        groups: Groups,
    ) -> tuple[Array, Array]:
        """The same as :func:`products_with`: (blocks, p, p) and (blocks, p, k).

        Parameters
        ----------
        columns : (rows, n), g; places : (blocks, k), the rows of each block
        """
        p = self.inside.shape[1]
        own, across = np.empty((level.size, p, p)), np.empty((level.size, p, places.shape[1]))
        for members, whitener in groups:
            made = whitener.rows(self.series)
            back = whitener.back(made)
            inside = self.inside[members]
            own[members] = inside @ (made @ made.T) @ np.swapaxes(inside, -1, -2)
            few, place = np.unique(places[members], return_inverse=True)
            with_each = (back @ columns[few].T)[:, place.reshape(members.size, -1)]
            across[members] = inside @ np.swapaxes(with_each, 0, 1)
        scale = level[:, None, None] ** 2
        return own / scale, across / scale


def spanned(columns: Array) -> Spanned | None:
    """Columns (blocks, n, p) by the few series that span them; None if it takes more than a part of them to do so."""
    blocks, n, p = columns.shape
    if blocks * p < _MANY:
        return None
    flat = np.swapaxes(columns, 0, 1).reshape(n, blocks * p)
    size = np.linalg.norm(flat, axis=0)
    made: tuple[Array, Array, NDArray[np.intp]] = qr(  # pyright: ignore[reportAssignmentType]  # by its arguments
        flat / np.where(size > 0.0, size, 1.0), mode="economic", pivoting=True, check_finite=False
    )
    basis, upper, order = made
    diagonal = np.abs(np.diagonal(upper))
    count = int(np.count_nonzero(diagonal > _ROUNDING * diagonal[0]))
    if count * _PART > min(blocks * p, n):
        return None
    inside = np.empty((blocks * p, count))
    inside[order] = upper[:count].T
    inside *= size[:, None]
    return Spanned(np.ascontiguousarray(basis[:, :count].T), inside.reshape(blocks, p, count))


def _squares(columns: Array, whitener: Whitener) -> Array:
    """Products (rows, grid, p, p) of columns (rows, n, grid, p) with each other after whitening."""
    rows, n, grid, p = columns.shape
    white = whitener.rows(columns.transpose(0, 2, 3, 1).reshape(rows * grid, p, n))
    return (white @ np.swapaxes(white, -1, -2)).reshape(rows, grid, p, p)
