"""What a model and its measurements say about the shares of the noise: products of its columns at any shares."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.candidate import Candidate
from inertial.criticism.noise_shares import Shares
from inertial.criticism.problem import Problem
from inertial.criticism.products import PIECE

Array = NDArray[np.float64]

_HANGING = 1e-3
"""Independent part of a column below which a single factorisation is inaccurate."""

VANISHING = 3e-5
"""Singular value of columns of unit length, over the largest, below which a combination of them vanishes."""

_FAR = 1e3
"""Multiple of the limit, of the squares, above which the eigenvalues of the products of columns decide on their rank."""

_KEPT = 1_000_000
"""Largest number of products that are kept for models with one more term."""


class ShareStatistics:
    """Products of the columns with coefficients by block, and of the measurements, with each other.

    Parameters
    ----------
    local : (blocks, n, p), columns, g per unit of the coefficient
    before : those of a model without its last term, whose products serve all that follow it; None without one
    further : the columns of the last term, at one value of its parameters
    """

    def __init__(
        self,
        problem: Problem,
        local: Array,
        before: "ShareStatistics | None" = None,
        further: Candidate | None = None,
    ) -> None:
        self.problem, self.local = problem, local
        self.whole = self._determined is local
        # a combination that vanishes mixes the columns: then all are whitened together
        nested = before is not None and further is not None and self.whole and before.whole
        self._before, self._further = (before, further) if nested else (None, None)
        self._kept: dict[Shares, Array] = {}

    @property
    def rank(self) -> int:
        """Number of columns without combinations that vanish."""
        return int(self._determined.shape[-1])

    @cached_property
    def _determined(self) -> Array:
        """Columns (blocks, n, r) that span those with coefficients by block, without combinations that vanish.

        Of misalignment only three of six columns show in a norm, and a turn about one axis shows two of three forces. Counted
        among the information, a combination that vanishes takes off ln F per share F of wander: the largest would always be best.
        """
        there = self.problem.covariance.there.astype(np.float64)
        products = np.swapaxes(self.local, -1, -2) @ (self.local * there[..., None])
        size = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 0.0))
        size = np.where(size > 0.0, size, 1.0)
        squares = np.linalg.eigvalsh(products / (size[:, :, None] * size[:, None, :]))
        if not squares.size or bool(np.all(squares[:, 0] > _FAR * VANISHING**2 * squares[:, -1])):
            return self.local
        unit = self.local * there[..., None] / size[:, None, :]
        _, values, turn = np.linalg.svd(unit, full_matrices=False)
        ranks = np.sum(values > VANISHING * values[:, :1], axis=1)
        rank = int(ranks.max())
        if rank == self.local.shape[-1] or int(ranks.min()) != rank:
            return self.local
        scaled = self.local / np.where(size > 0.0, size, 1.0)[:, None, :]
        return scaled @ np.swapaxes(turn[:, :rank], -1, -2)

    @cached_property
    def _rows(self) -> Array:
        """Determined columns, and the measurements behind them, as rows, (blocks, r + 1, n).

        Of the measurements a plain fit is taken off before: what the model leaves of them is a millionth of their squares. With
        products of a model without the last term, it is the fit of that model: the measurements are the same in all of them.
        """
        if self._before is not None and self._further is not None:
            before, further = self._before._rows, self._further.of_blocks[:, :, 0]  # noqa: SLF001  # of its own kind
            return np.concatenate([before[:, :-1], np.swapaxes(further, -1, -2), before[:, -1:]], axis=1)
        x, y = self._determined, self.problem.y[..., None]
        there = self.problem.covariance.there[..., None]
        own = x * there
        size = np.sqrt(np.einsum("bnp,bnp->bp", own, own))
        unit = own / np.where(size > 0.0, size, 1.0)[:, None, :]
        across = np.swapaxes(unit, -1, -2)
        fitted = unit @ (np.linalg.pinv(across @ unit, rcond=1e-12, hermitian=True) @ (across @ y))
        rows = np.empty((self.problem.blocks, x.shape[-1] + 1, self.problem.n))
        rows[:, :-1] = np.swapaxes(x, -1, -2)
        rows[:, -1] = ((y - fitted) * there)[..., 0]
        return rows

    @cached_property
    def _distinct(self) -> tuple[Array, NDArray[np.intp]]:
        """The columns that differ, (rows, n), and where each column of each block is among them, (blocks, r + 1)."""
        blocks = self.problem.blocks
        few: list[Array] = []
        places: list[NDArray[np.intp]] = []
        count = 0
        for column in np.swapaxes(self._rows, 0, 1):
            rows = self.problem.rows_of(column)
            few.append(column if rows is None else column[np.unique(rows, return_index=True)[1]])
            places.append(count + (np.arange(blocks) if rows is None else rows))
            count += len(few[-1])
        return np.concatenate(few), np.stack(places, axis=1)

    def products(self, shares: Shares) -> Array:
        """Products (blocks, r + 1, r + 1) of the determined columns and the measurements with each other."""
        if shares not in self._kept:
            made = self._whole(shares) if self._before is None or self._further is None else self._nested(shares)
            while self._kept and (len(self._kept) + 1) * made.size > _KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[shares] = made
        return self._kept[shares]

    def _whole(self, shares: Shares) -> Array:
        """The products of all columns that differ."""
        covariance = self.problem.covariance
        columns, places = self._distinct
        out = np.empty((self.problem.blocks, places.shape[1], places.shape[1]))
        for members, own, rows in covariance.solved(columns, places, shares):
            each = np.searchsorted(own, places[members])
            few = max(PIECE // (each.shape[1] * self.problem.n), 1)
            for some in (slice(start, start + few) for start in range(0, members.size, few)):
                out[members[some]] = rows[each[some]] @ np.swapaxes(self._rows[members[some]], -1, -2)
        out /= covariance.level[:, None, None] ** 2
        return out

    def _nested(self, shares: Shares) -> Array:
        """Those of the model without its last term, and those of this term: V⁻¹ is applied to the columns of the term alone."""
        if self._before is None or self._further is None:
            return self._whole(shares)
        known, rows = self._before.products(shares), self._before._rows  # noqa: SLF001  # of its own kind
        own, across = self.problem.covariance.products_with(self._further, rows, shares)
        # the measurements stay last
        r = known.shape[-1] - 1
        above = np.concatenate([known[:, :r, :r], np.swapaxes(across, -1, -2)[:, :r], known[:, :r, r:]], axis=-1)
        beside = np.concatenate([across[..., :r], own, across[..., r:]], axis=-1)
        last = np.concatenate([known[:, r:, :r], np.swapaxes(across, -1, -2)[:, r:], known[:, r:, r:]], axis=-1)
        return np.concatenate([above, beside, last], axis=1)

    def at(self, shares: Shares) -> tuple[float, Array] | None:
        """log|HᵀV⁻¹H| and sums of squares (blocks,), by one factorisation; None if columns are collinear."""
        products = self.products(shares)
        size = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 1e-300))
        try:
            root = np.linalg.cholesky(products / (size[:, :, None] * size[:, None, :]))
        except np.linalg.LinAlgError:
            return None
        diagonal = np.diagonal(root, axis1=-2, axis2=-1)
        if float(diagonal[:, :-1].min(initial=1.0)) < _HANGING:
            return None
        information = 2.0 * float(np.sum(np.log(diagonal[:, :-1] * size[:, :-1])))
        return information, np.asarray((diagonal[:, -1] * size[:, -1]) ** 2, dtype=np.float64)
