"""Restricted likelihood of the noise shares from products of a model's columns and measurements, without a whitened space."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inertial.arrays import Array, Places
from inertial.estimation.bases import SEEN, unit_columns
from inertial.estimation.candidate import shared_rows
from inertial.estimation.covariance import PIECE
from inertial.estimation.noise_shares import Shares
from inertial.estimation.problem import Problem

VANISHING = 3e-5
"""Relative singular value of unit-length columns below which a combination of them counts as zero."""

_VANISHED = 1e-7
"""The same for columns that all blocks share: root of the smallest relative eigenvalue that a fit of them uses."""

_ROUNDING = 1e-11
"""Norm of a column after a fit, over its norm before, below which the remainder is rounding error."""

_FAR = 1e3
"""Factor above the squared limit of singular values at which the eigenvalues of the Gram matrix suffice to decide the rank."""

_HANGING = 1e-3
"""Diagonal of the Cholesky factor of unit-length columns below which the factorisation is inaccurate."""

_FIRM = 1e4
"""Largest inverse eigenvalue of the Gram matrix of unit-length columns at which the order of the columns does not matter."""

_ABSORBED = 1e-8
"""Share of a shared column's sum of squares after the local columns, below which products are too inaccurate."""


@dataclass(frozen=True)
class Left:
    """Residuals of the measurements after a fit of local columns H (coefficients by block) and shared columns.

    information : log|HᵀV⁻¹H|; squares : (blocks,), whitened residual sums of squares
    sizes : (q + 1,), weights of the shared columns and of the measurements in the residual; None without shared columns
    root : (blocks, r, r), Cholesky factor, lower, of the Gram matrix of the unit-length local columns
    """

    information: float
    squares: Array
    sizes: Array | None = None
    root: Array | None = None

    @property
    def firm(self) -> bool:
        """Whether the result does not depend on the order of the columns, because no combination of them is nearly zero.

        The smallest eigenvalue of the Gram matrix is at least one over the sum of squares of the inverse factor.
        """
        if self.root is None:
            return False
        return float(np.max(np.sum(np.linalg.inv(self.root) ** 2, axis=(1, 2)), initial=0.0)) < _FIRM


class ShareStatistics:
    """Products, at any noise shares, of a model's columns and measurements with each other.

    Parameters
    ----------
    local : (blocks, n, p), g per unit of the coefficient, columns with coefficients by block
    shared : (blocks, n, q), g per unit of the coefficient, columns whose coefficients all blocks share
    """

    def __init__(self, problem: Problem, local: Array, shared: Array) -> None:
        self.problem, self._local, self._shared = problem, local, shared
        self._store: dict[Shares, Array] = {}
        self._single: dict[tuple[int, Shares], Array] = {}

    @property
    def rank(self) -> int:
        """Number of linearly independent local columns, as of :data:`VANISHING`."""
        return int(self._determined.shape[-1])

    @property
    def _independent(self) -> bool:
        """Whether the local columns are linearly independent."""
        return self._determined is self._local

    @cached_property
    def _determined(self) -> Array:
        """Linearly independent columns (blocks, n, r) with the span of the local ones; the local ones where ranks differ.

        In a norm only three of six misalignment columns are visible, and rotation about one axis shows two of three forces.
        Counted in the information, a zero combination would lower the deviance by ln F for a share F of wander: the largest
        share would always be best.
        """
        there = self.problem.covariance.there.astype(np.float64)
        products = np.swapaxes(self._local, -1, -2) @ (self._local * there[..., None])
        size = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 0.0))
        size = np.where(size > 0.0, size, 1.0)
        squares = np.linalg.eigvalsh(products / (size[:, :, None] * size[:, None, :]))
        if not squares.size or bool(np.all(squares[:, 0] > _FAR * VANISHING**2 * squares[:, -1])):
            return self._local
        unit = self._local * there[..., None] / size[:, None, :]
        _, values, turn = np.linalg.svd(unit, full_matrices=False)
        ranks = np.sum(values > VANISHING * values[:, :1], axis=1)
        rank = int(ranks.max())
        if rank == self._local.shape[-1] or int(ranks.min()) != rank:
            return self._local
        return (self._local / size[:, None, :]) @ np.swapaxes(turn[:, :rank], -1, -2)

    @cached_property
    def _rows(self) -> Array:
        """Independent local columns, directions of the shared ones, and measurements as rows (blocks, r + q + 1, n).

        A fit of equal weights is subtracted from the measurements first: their residuals have a millionth of their squares.
        """
        y = self._after_plain_fit(self.problem.y[..., None])
        return np.swapaxes(np.concatenate([self._determined, self._directions, y], axis=-1), -1, -2)

    def _after_plain_fit(self, series: Array) -> Array:
        """Residuals of series (blocks, n, k) after a fit of the local columns with equal weights."""
        there = self.problem.covariance.there[..., None]
        unit = unit_columns(self._determined * there)[0]
        across = np.swapaxes(unit, -1, -2)
        fitted = unit @ (np.linalg.pinv(across @ unit, rcond=1e-12, hermitian=True) @ (across @ series))
        return (series - fitted) * there

    @cached_property
    def _directions(self) -> Array:
        """Orthonormal basis (blocks, n, r) of the shared columns after a fit of the local ones, without directions of zero."""
        q = self._shared.shape[-1]
        if not q:
            return self._shared
        size = np.linalg.norm((self._shared * self.problem.covariance.there[..., None]).reshape(-1, q), axis=0)
        flat = self._after_plain_fit(self._shared).reshape(-1, q) / np.where(size > 0.0, size, 1.0)
        left, values, _ = np.linalg.svd(flat, full_matrices=False)
        seen = values > max(_VANISHED * values[0], _ROUNDING)
        return left[:, seen].reshape(*self._shared.shape[:2], -1)

    @cached_property
    def _distinct(self) -> tuple[Array, Places]:
        """The distinct rows of :attr:`_rows`, (m, n), and their index for each row of each block, (blocks, r + q + 1)."""
        blocks = self.problem.blocks
        few: list[Array] = []
        column_of: list[Places] = []
        count = 0
        for column in np.swapaxes(self._rows, 0, 1):
            rows = shared_rows(column, self.problem.per_unit)
            few.append(column if rows is None else column[np.unique(rows, return_index=True)[1]])
            column_of.append(count + (np.arange(blocks) if rows is None else rows))
            count += len(few[-1])
        return np.concatenate(few), np.stack(column_of, axis=1)

    def _products(self, shares: Shares) -> Array:
        """Products xᵀV⁻¹y (blocks, r + q + 1, r + q + 1) of all :attr:`_rows` with each other."""
        common = shares.common
        if common not in self._store:
            self._store = {common: self._made(common)}  # only the latest: a search for shares seldom goes back
        products = self._store[common]
        if shares.by_block:
            products = products.copy()
            for block, flicker, walk in shares.by_block:
                products[block] = self._of_block(block, Shares(flicker, walk))
        return products

    def _made(self, shares: Shares) -> Array:
        covariance = self.problem.covariance
        columns, column_of = self._distinct
        out = np.empty((self.problem.blocks, column_of.shape[1], column_of.shape[1]))
        for members, distinct, rows in covariance.solved(columns, column_of, shares):
            each = np.searchsorted(distinct, column_of[members])
            few = max(PIECE // (each.shape[1] * self.problem.n), 1)
            for some in (slice(start, start + few) for start in range(0, members.size, few)):
                out[members[some]] = rows[each[some]] @ np.swapaxes(self._rows[members[some]], -1, -2)
        out /= covariance.level[:, None, None] ** 2
        return out

    def _of_block(self, block: int, shares: Shares) -> Array:
        """The products of one block, (r + q + 1, r + q + 1), at given shares."""
        if shares in self._store:
            return self._store[shares][block]
        if (block, shares) not in self._single:
            covariance = self.problem.covariance
            made = covariance.whitener_of_block(block, shares).rows(self._rows[block])
            self._single[block, shares] = made @ made.T / covariance.level[block] ** 2
        return self._single[block, shares]

    def left(self, shares: Shares, scale: Array) -> Left | None:
        """The residuals of the measurements; None if columns are nearly collinear.

        Parameters
        ----------
        scale : (blocks,), standard deviations that weight the blocks in the estimate of shared coefficients
        """
        if not self._shared.shape[-1]:
            return _factorised(self._products(shares))
        return _with_shared(self._products(shares), self.rank, scale) if self._independent else None

    def left_of_block(self, block: int, shares: Shares, sizes: Array | None = None) -> Left | None:
        """The residuals of one block; None if columns are nearly collinear.

        Parameters
        ----------
        sizes : (q + 1,), fixed weights of the shared columns and of the measurements in the series; None without shared columns
        """
        if not self._independent:
            return None
        products = self._of_block(block, shares)
        if sizes is not None:
            turn = np.zeros((len(products), self.rank + 1))
            turn[range(self.rank), range(self.rank)] = 1.0
            turn[self.rank :, -1] = sizes
            products = turn.T @ products @ turn
        return _factorised(products[None])


def _factorised(products: Array) -> Left | None:
    """Residuals of the measurements after local columns; None if these are nearly collinear.

    Parameters
    ----------
    products : (blocks, r + 1, r + 1), Gram matrices of the columns and, last, the measurements
    """
    size = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 1e-300))
    try:
        root = np.linalg.cholesky(products / (size[:, :, None] * size[:, None, :]))
    except np.linalg.LinAlgError:
        return None
    diagonal = np.diagonal(root, axis1=-2, axis2=-1)
    if float(diagonal[:, :-1].min(initial=1.0)) < _HANGING:
        return None
    information = 2.0 * float(np.sum(np.log(diagonal[:, :-1] * size[:, :-1])))
    squares = np.asarray((diagonal[:, -1] * size[:, -1]) ** 2, dtype=np.float64)
    return Left(information, squares, root=np.asarray(root[:, :-1, :-1], dtype=np.float64))


def _with_shared(products: Array, rank: int, scale: Array) -> Left | None:
    """As :func:`_factorised`, with shared columns after the first ``rank``; ``scale`` as in :meth:`ShareStatistics.left`."""
    size = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 1e-300))
    unit = products / (size[:, :, None] * size[:, None, :])
    inner, across = unit[:, :rank, :rank], unit[:, :rank, rank:]
    values = np.linalg.eigvalsh(inner)
    if float(values[:, :1].min(initial=1.0)) < SEEN**2:
        return None  # the log-determinant of :func:`basis` limits such eigenvalues
    left = unit[:, rank:, rank:] - np.swapaxes(across, -1, -2) @ np.linalg.solve(inner, across)
    left *= size[:, rank:, None] * size[:, None, rank:]
    summed = np.sum(left / scale[:, None, None] ** 2, axis=0)
    before = np.sum((size[:, rank:] / scale[:, None]) ** 2, axis=0)
    after = np.diagonal(summed)
    if float((after[:-1] / before[:-1]).min(initial=1.0)) < _ABSORBED:
        return None
    root = np.sqrt(after[:-1])
    gram, right = summed[:-1, :-1] / np.outer(root, root), summed[:-1, -1] / root
    if float(np.linalg.eigvalsh(gram).min(initial=1.0)) < _ABSORBED:
        return None
    sizes = np.append(-np.linalg.solve(gram, right) / root, 1.0)
    information = float(np.sum(np.log(values))) + 2.0 * float(np.sum(np.log(size[:, :rank])))
    return Left(information, np.einsum("s,bst,t->b", sizes, left, sizes), sizes)
