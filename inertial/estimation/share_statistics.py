"""What a model and its measurements say about the shares of the noise: products of its columns at any shares."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.estimation.candidate import Candidate
from inertial.estimation.factors import Left, beside_common, factorised
from inertial.estimation.noise_shares import Shares
from inertial.estimation.problem import Problem
from inertial.estimation.products import PIECE, Spanned, spanned

Array = NDArray[np.float64]

VANISHING = 3e-5
"""Singular value of columns of unit length, over the largest, below which a combination of them vanishes."""

_VANISHED = 1e-7
"""The same of columns that all blocks share: the root of the smallest share of products that counts in a fit of them."""

_ROUNDING = 1e-11
"""Part of a column below which what a fit leaves of it is rounding."""

_FAR = 1e3
"""Multiple of the limit, of the squares, above which the eigenvalues of the products of columns decide on their rank."""

_KEPT = 1_000_000
"""Largest number of products that are kept for models with one more term."""


class ShareStatistics:
    """Products of the columns with coefficients by block, and of the measurements, with each other.

    Parameters
    ----------
    local : (blocks, n, p), columns, g per unit of the coefficient
    shared : (blocks, n, q), columns whose coefficients all blocks share; None for none
    before : those of a model without its last term, whose products serve all that follow it; None without one
    further : the columns of the last term, at one value of its parameters
    """

    def __init__(
        self,
        problem: Problem,
        local: Array,
        before: "ShareStatistics | None" = None,
        further: Candidate | None = None,
        shared: Array | None = None,
    ) -> None:
        self.problem, self.local = problem, local
        self._shared = local[..., :0] if shared is None else shared
        self.whole = self._determined is local
        # a combination that vanishes mixes the columns: then all are whitened together
        nested = before is not None and further is not None and self.whole and before.whole
        self._before, self._further = (before, further) if nested else (None, None)
        self._kept: dict[Shares, Array] = {}
        self._single: dict[tuple[int, Shares], Array] = {}

    @property
    def rank(self) -> int:
        """Number of columns with coefficients by block, without combinations that vanish."""
        return int(self._determined.shape[-1])

    @cached_property
    def _common(self) -> NDArray[np.bool_]:
        """Whether all blocks share the coefficient of each column, in the order of the products, (r,)."""
        if self._before is None or self._further is None:
            return np.repeat([False, True], [self.rank, self._independent.shape[-1]])
        return np.append(self._before._common, np.full(self._further.columns.shape[-1], self._further.shared))  # noqa: SLF001

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
        """The columns, and the measurements behind them, as rows, (blocks, r + 1, n).

        Of the measurements a plain fit is taken off before: what the model leaves of them is a millionth of their squares. With
        products of a model without the last term, it is the fit of that model: the measurements are the same in all of them.
        """
        if self._before is None or self._further is None:
            columns = np.concatenate([self._determined, self._independent], axis=-1)
            y = self._after_plain_fit(self.problem.y[..., None])
            return np.swapaxes(np.concatenate([columns, y], axis=-1), -1, -2)
        rows, further = self._before._rows, self._further.of_blocks[:, :, 0]  # noqa: SLF001  # of its own kind
        return np.concatenate([rows[:, :-1], np.swapaxes(further, -1, -2), rows[:, -1:]], axis=1)

    def _rows_of(self, block: int) -> Array:
        """The rows (r + 1, n) of one block."""
        if "_rows" in self.__dict__ or self._before is None or self._further is None:
            return self._rows[block]
        before, row_of = self._before._rows_of(block), self._further.rows  # noqa: SLF001  # of its own kind
        further = self._further.columns[block if row_of is None else row_of[block], :, 0]
        return np.concatenate([before[:-1], further.T, before[-1:]])

    def _after_plain_fit(self, series: Array) -> Array:
        """What the columns with coefficients by block leave of series (blocks, n, k) in a fit of equal weights."""
        there = self.problem.covariance.there[..., None]
        own = self._determined * there
        size = np.sqrt(np.einsum("bnp,bnp->bp", own, own))
        unit = own / np.where(size > 0.0, size, 1.0)[:, None, :]
        across = np.swapaxes(unit, -1, -2)
        fitted = unit @ (np.linalg.pinv(across @ unit, rcond=1e-12, hermitian=True) @ (across @ series))
        return (series - fitted) * there

    @cached_property
    def _independent(self) -> Array:
        """Directions of the columns that all blocks share."""
        return self.independent(self._shared) if self._shared.shape[-1] else self._shared

    def independent(self, shared: Array) -> Array:
        """Orthonormal directions (blocks, n, r) that span columns (blocks, n, q) of all blocks, without those that vanish.

        A plain fit of the columns with coefficients by block is taken off before.
        """
        q = shared.shape[-1]
        size = np.linalg.norm((shared * self.problem.covariance.there[..., None]).reshape(-1, q), axis=0)
        flat = self._after_plain_fit(shared).reshape(-1, q) / np.where(size > 0.0, size, 1.0)
        left, values, _ = np.linalg.svd(flat, full_matrices=False)
        seen = values > max(_VANISHED * values[0], _ROUNDING)
        return left[:, seen].reshape(*shared.shape[:2], -1)

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
        """Products (blocks, r + 1, r + 1) of the columns and the measurements with each other."""
        made = self._alike(shares.common)
        if shares.own:
            made = made.copy()
            for block, flicker, walk in shares.own:
                made[block] = self.of_block(block, Shares(flicker, walk))
        return made

    def _alike(self, shares: Shares) -> Array:
        """The same at shares that no block has for itself; they are kept, whatever shares of their own some blocks have."""
        if shares not in self._kept:
            made = self._whole(shares) if self._before is None or self._further is None else self._nested(shares)
            while self._kept and (len(self._kept) + 1) * made.size > _KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[shares] = made
        return self._kept[shares]

    def of_block(self, block: int, shares: Shares) -> Array:
        """Products (r + 1, r + 1) of one block, at shares that are its own or the lot's."""
        if shares in self._kept:
            return self._kept[shares][block]
        if (block, shares) not in self._single:
            covariance = self.problem.covariance
            made = covariance.whitener_of_block(block, shares).rows(self._rows_of(block))
            self._single[block, shares] = made @ made.T / covariance.level[block] ** 2
        return self._single[block, shares]

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
        known = self._before.products(shares)
        own, across = self._with_further(self._before, self._further, shares)
        # the measurements stay last
        r = known.shape[-1] - 1
        above = np.concatenate([known[:, :r, :r], np.swapaxes(across, -1, -2)[:, :r], known[:, :r, r:]], axis=-1)
        beside = np.concatenate([across[..., :r], own, across[..., r:]], axis=-1)
        last = np.concatenate([known[:, r:, :r], np.swapaxes(across, -1, -2)[:, r:], known[:, r:, r:]], axis=-1)
        return np.concatenate([above, beside, last], axis=1)

    def _with_further(self, before: "ShareStatistics", further: Candidate, shares: Shares) -> tuple[Array, Array]:
        """Products of the columns of the last term, with each other and with all those before it."""
        covariance = self.problem.covariance
        if self._spanned is None:
            return covariance.products_with(further, before._rows, shares)  # noqa: SLF001  # of its own kind
        return covariance.products_of_spanned(self._spanned, *before._distinct, shares)  # noqa: SLF001

    @cached_property
    def _spanned(self) -> Spanned | None:
        """The columns of the last term by the few series that span them; None if it takes too many."""
        if self._further is None or self._further.rows is not None:
            return None
        return spanned(self._further.columns[:, :, 0])

    def at(self, shares: Shares) -> Left | None:
        """What is left of the measurements, by one factorisation; None if columns are collinear."""
        return factorised(self.products(shares))

    def beside_shared(self, shares: Shares, scale: Array) -> Left | None:
        """The same where all blocks share some coefficients; None if any columns are collinear.

        Parameters
        ----------
        scale : (blocks,), standard deviations of the blocks, by which they weigh in the common coefficients
        """
        if not self.whole:
            return None
        return beside_common(self.products(shares), self._common, scale)

    def left_of_block(self, block: int, shares: Shares, sizes: Array | None = None) -> Left | None:
        """What is left of the measurements of one block; None if columns are collinear.

        Parameters
        ----------
        sizes : (q + 1,), what the columns that all blocks share, and the measurements, have in the series; None if there are none
        """
        if not self.whole:
            return None
        products = self.of_block(block, shares)
        if sizes is not None:
            turn = np.zeros((len(products), self.rank + 1))
            turn[np.flatnonzero(~self._common), np.arange(self.rank)] = 1.0
            turn[np.append(np.flatnonzero(self._common), len(products) - 1), -1] = sizes
            products = turn.T @ products @ turn
        return factorised(products[None])
