"""Residuals of a model and their reduction by a further effect: projections in the whitened space.

A block is the series of one unit and axis, with coefficients of its own (local columns). Columns shared by all blocks (effects
of the station) are targets like the measurements, so that adding a local column only updates a small Gram matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inertial.arrays import Array, Flags, Places
from inertial.estimation.bases import SEEN, basis, eigen, inverse_roots, schur
from inertial.estimation.candidate import Candidate, times_rows
from inertial.estimation.covariance import Covariance
from inertial.estimation.noise_shares import Noise

_PIECE = 500_000
"""Largest number of column elements that are whitened at a time."""


@dataclass(frozen=True)
class Products:
    """Products of a candidate's columns in a whitened space, for each value of its nonlinear parameters.

    whole : (b, grid, p, p), with each other, before projection on the local columns
    along : (b, grid, p, r), with the orthonormal local columns of the model
    inside : (b, grid, p, t), with the targets (measurements, then shared columns)
    """

    whole: Array
    along: Array
    inside: Array

    @property
    def left(self) -> Array:
        """Products (b, grid, p, p) of the columns with each other after projection on the local columns."""
        return self.whole - self.along @ np.swapaxes(self.along, -1, -2)

    @property
    def squares(self) -> Array:
        """Sums of squares (b, grid, p) of the columns before projection on the local columns."""
        return np.diagonal(self.whole, axis1=-2, axis2=-1)


@dataclass(frozen=True)
class Gain:
    """Reduction of the whitened sum of squares by a candidate, for each value of its nonlinear parameters.

    drop : (grid,), reduction of the whitened sum of squares
    rank : (grid,), number of coefficients that the plan determines
    by_block : (blocks, grid), reduction by block; (0, grid) for coefficients that blocks share
    common, common_rank : (grid,), the same two with coefficients by axis that all units share
    """

    drop: Array
    rank: Places
    by_block: Array
    common: Array
    common_rank: Places

    @staticmethod
    def joined(parts: Sequence["Gain"]) -> "Gain":
        """The gain over a grid that was processed in parts."""
        if len(parts) == 1:
            return parts[0]
        return Gain(
            np.concatenate([p.drop for p in parts]),
            np.concatenate([p.rank for p in parts]),
            np.concatenate([p.by_block for p in parts], axis=1),
            np.concatenate([p.common for p in parts]),
            np.concatenate([p.common_rank for p in parts]),
        )


class Space:
    """The residuals of a model, whitened for its noise: of variance one if the model is correct.

    Parameters
    ----------
    y : (blocks, n), measurements, g
    local : (blocks, n, p), g per unit of the coefficient, columns with coefficients per block
    shared : (blocks, n, q), g per unit of the coefficient, columns whose coefficients all blocks share
    """

    def __init__(self, covariance: Covariance, noise: Noise, y: Array, local: Array, shared: Array) -> None:
        self.covariance, self.noise = covariance, noise
        self._local = local
        blocks, n, p = local.shape
        t = 1 + shared.shape[-1]
        self.q: Array = np.empty((blocks, n, p))
        self.targets: Array = np.empty((blocks, n, t))
        self.ranks, self._log_determinant = np.empty(blocks, dtype=np.intp), 0.0
        # in groups of blocks, because every step allocates several arrays of the size of their columns
        few = max(_PIECE // (n * (p + t)), 1)
        for some in np.split(np.arange(blocks), range(few, blocks, few)):
            columns = np.concatenate([y[some, :, None], shared[some], local[some]], axis=-1)
            white = covariance.whiten(columns, noise.shares, some) / noise.scale[some, None, None]
            self.q[some], self.ranks[some], log_determinant = basis(white[..., t:])
            self._log_determinant += log_determinant
            self.targets[some] = self.project(white[..., :t], some)
        self.gram = np.einsum("bnt,bns->ts", self.targets, self.targets)
        self.local_rank = int(self.ranks.sum())
        self.shared_rank = int(np.linalg.matrix_rank(self.gram[1:, 1:], tol=None)) if shared.shape[-1] else 0

    def whiten(self, columns: Array) -> Array:
        """Columns (blocks, n, m), g, whitened to noise of variance one."""
        return self.covariance.whiten(columns, self.noise.shares) / self.noise.scale[:, None, None]

    @property
    def local(self) -> Array:
        """The whitened columns with coefficients per block, (blocks, n, p)."""
        return self.whiten(self._local)

    @cached_property
    def rss(self) -> float:
        """Whitened residual sum of squares of the model."""
        return schur(self.gram)

    @cached_property
    def dof(self) -> int:
        """Degrees of freedom of the residuals."""
        return int(self.covariance.count.sum()) - self.local_rank - self.shared_rank

    @cached_property
    def by_block(self) -> Array:
        """Residual degrees of freedom of each block, (blocks,)."""
        return np.maximum(self.covariance.count - self.ranks, 0).astype(np.float64)

    @cached_property
    def squares(self) -> Array:
        """Residual sum of squares of each block over its stated white variance, (blocks,), not divided by the scale."""
        return np.einsum("bn,bn->b", self.residual, self.residual) * self.noise.scale**2

    @cached_property
    def variance(self) -> float:
        """Mean square of the residuals: one if the noise is that of this model."""
        return self.rss / max(self.dof, 1)

    @cached_property
    def logdet(self) -> float:
        """Log-determinant of the covariance of all blocks, without the scales."""
        return float(np.sum(self.covariance.logdet(self.noise.shares)))

    @cached_property
    def residual(self) -> Array:
        """Whitened residuals, (blocks, n)."""
        if self.targets.shape[-1] == 1:
            return self.targets[..., 0]
        return self.targets[..., 0] - self.targets[..., 1:] @ self.shared_sizes

    @property
    def shared_sizes(self) -> Array:
        """Coefficients (q,) of the columns that all blocks share."""
        return np.linalg.lstsq(self.gram[1:, 1:], self.gram[1:, 0], rcond=1e-10)[0].astype(np.float64)

    @property
    def information(self) -> float:
        """log|HᵀV⁻¹H| of the local columns over all blocks, without the scales."""
        return self._log_determinant + 2.0 * self._local.shape[-1] * float(np.sum(np.log(self.noise.scale)))

    @property
    def deleted(self) -> tuple[Array, Array]:
        """(Py)_i in 1/g and P_ii in 1/g² of every dwell, (blocks, n), with P = V⁻¹ − V⁻¹H(HᵀV⁻¹H)⁻¹HᵀV⁻¹.

        The deletion residual of a dwell is (Py)_i/P_ii, with variance 1/P_ii.
        """
        back = self.backed(np.concatenate([self.residual[..., None], self.q], axis=-1))
        along = np.einsum("bkn,bkn->bn", back[:, 1:], back[:, 1:])
        return back[:, 0], np.maximum(self.covariance.precision(self.noise) - along, 0.0)

    def projector_at(self, block: int, dwell: int) -> Array:
        """The column (n,), 1/g², of one block's P that belongs to a dwell."""
        at = np.zeros((1, self.q.shape[1], 1))
        at[0, dwell] = 1.0
        white = self.covariance.whiten(at, self.noise.shares, np.array([block])) / self.noise.scale[block]
        left = self.project(white, np.array([block]))
        scale = float(self.covariance.level[block] * self.noise.scale[block])
        return self.covariance.back(np.swapaxes(left, -1, -2), self.noise.shares, np.array([block]))[0, 0] / scale

    def project(self, columns: Array, blocks: Places | None = None) -> Array:
        """Whitened columns (blocks, n, m) after projection on the local columns: their residuals."""
        q = self.q if blocks is None else self.q[blocks]
        return columns - q @ (np.swapaxes(q, -1, -2) @ columns)

    def backed(self, white: Array) -> Array:
        """Rows (blocks, k, n), 1/g: their products with series in g are those of ``white`` (blocks, n, k) with whitened ones."""
        rows = self.covariance.back(np.swapaxes(white, -1, -2), self.noise.shares)
        rows /= (self.covariance.level * self.noise.scale)[:, None, None]
        return rows

    @cached_property
    def _rows(self) -> Array:
        """The result of :meth:`backed` for the orthonormal local columns and the targets, (blocks, r + t, n)."""
        return self.backed(np.concatenate([self.q, self.targets], axis=-1))

    def products(self, candidate: Candidate) -> Products:
        """Products of a candidate's columns; only their squares need the whitened columns.

        With the whitener W, local columns Q and targets t in the whitened space, QᵀWc and tᵀWc are precomputed rows times the
        columns c in g, and cᵀV⁻¹c depends on neither model nor measurements. A visible column keeps more than 1e-4 of its square
        after projection on Q, so that subtracting from the products instead of the columns loses no significant digit.
        """
        with_rows = times_rows(self._rows, candidate)
        local = self.q.shape[-1]
        scale = self.noise.scale if candidate.blocks is None else self.noise.scale[candidate.blocks]
        gram = self.covariance.products(candidate, self.noise.shares) / scale[:, None, None, None] ** 2
        return Products(gram, with_rows[..., :local], with_rows[..., local:])

    def gain(self, candidate: Candidate) -> Gain:
        """Reduction of the residuals by a candidate."""
        found = self.products(candidate)
        if candidate.shared:
            return self._gain_shared(found, per_unit=None if candidate.units is None else candidate.per_unit)
        size = np.sqrt(found.squares)
        size = np.where(size > 0.0, size, 1.0)
        values, vectors = eigen(found.left / (size[..., :, None] * size[..., None, :]))
        along = np.swapaxes(vectors, -1, -2) @ (found.inside / size[..., None])
        along *= inverse_roots(values, SEEN**2)[..., None]
        return self._gain_along(along, values > SEEN**2, self._common(found))

    def gain_of_dwells(self, columns: Array, dwells: Places) -> Gain:
        """Gain of columns that change a single dwell, for each of some dwells; all blocks share the coefficients.

        With P as in :attr:`deleted` a column of value t at dwell k has the product t²·P_kk with itself and t·(Py)_k with the
        measurements: no column is whitened.

        Parameters
        ----------
        columns : (blocks, n, p), g per unit of the coefficient, value of the columns at each dwell; dwells : (grid,), indices
        """
        n, p = columns.shape[1:]
        inside, left = np.zeros((n, p, self.targets.shape[-1])), np.zeros((n, p, p))
        size = np.zeros((n, p))
        for members, whitener in self.covariance.whiteners(self.noise.shares):
            scale = (self.covariance.level * self.noise.scale)[members, None]
            # P = Wᵀ(I − QQᵀ)W; the targets are projected already
            back = np.swapaxes(self.targets[members], -1, -2) @ whitener
            along = np.swapaxes(self.q[members], -1, -2) @ whitener
            precision = np.sum(whitener**2, axis=0) / scale**2
            diagonal = np.maximum(precision - np.einsum("brn,brn->bn", along, along) / scale**2, 0.0)
            inside += np.einsum("bnp,btn->npt", columns[members], back / scale[..., None])
            left += np.einsum("bnp,bnr,bn->npr", columns[members], columns[members], diagonal)
            size += np.einsum("bnp,bn->np", columns[members] ** 2, precision)
        size = np.sqrt(np.where(size > 0.0, size, 1.0))
        return self._solved((left / size[:, :, None] / size[:, None, :])[dwells], (inside / size[..., None])[dwells])

    def _common(self, found: Products) -> tuple[Array, Places]:
        """Reduction (grid,) by coefficients by axis that all units share, and their rank (grid,).

        Columns of the model that blocks share are not estimated again: beside such columns the reduction is a lower limit.
        """
        inside = found.inside[..., 0]
        if found.inside.shape[-1] > 1:
            inside = inside - found.inside[..., 1:] @ self.shared_sizes
        left, squares, inside = (
            each.reshape(-1, self.covariance.axes, *each.shape[1:]).sum(axis=0)
            for each in (found.left, found.squares, inside)
        )
        size = np.sqrt(np.where(squares > 0.0, squares, 1.0))
        values, vectors = eigen(left / (size[..., :, None] * size[..., None, :]))
        along = np.einsum("agpr,agp->agr", vectors, inside / size) * inverse_roots(values, SEEN**2)
        return np.sum(along**2, axis=(0, 2)), (values > SEEN**2).sum(axis=(0, 2))

    def _gain_along(self, along: Array, seen: Flags, common: tuple[Array, Places]) -> Gain:
        """Gain of local columns from their orthonormal directions' products (b, grid, p, t) with the targets."""
        rank = seen.sum(axis=(0, 2))
        if self.targets.shape[-1] == 1:
            by_block = np.einsum("bgr,bgr->bg", along[..., 0], along[..., 0])
            return Gain(by_block.sum(axis=0), rank, by_block, *common)
        left = self.gram - np.einsum("bgrt,bgrs->gts", along, along)
        drop = np.array([self.rss - schur(each, self.gram) for each in left])
        return Gain(drop, rank, self._by_block(along, left), *common)

    def _by_block(self, along: Array, left: Array) -> Array:
        """Reduction of each block's residual sum of squares, (blocks, grid), with the shared coefficients estimated again.

        Parameters
        ----------
        along : (blocks, grid, r, t), projections of the targets on the candidate; left : (grid, t, t), their products after it
        """
        size = np.sqrt(np.maximum(np.diagonal(self.gram)[1:], 1e-300))
        inner = np.linalg.pinv(left[:, 1:, 1:] / np.outer(size, size), rcond=1e-8, hermitian=True)
        again = np.einsum("gqp,gp->gq", inner, left[:, 1:, 0] / size) / size
        turned = np.concatenate([np.ones((len(left), 1)), -again], axis=-1)
        products = np.einsum("bnt,bns->bts", self.targets, self.targets)
        after = np.einsum("bts,gt,gs->bg", products, turned, turned, optimize=True)
        after -= np.sum(np.einsum("bgrt,gt->bgr", along, turned) ** 2, axis=-1)
        return np.einsum("bn,bn->b", self.residual, self.residual)[:, None] - after

    def _gain_shared(self, found: Products, *, per_unit: int | None) -> Gain:
        """Gain of columns with coefficients common to all blocks, or to each unit (grid: unit after unit, all values of each)."""
        together = per_unit or found.whole.shape[0]
        left, squares, inside = (
            each.reshape(-1, together, *each.shape[1:]).sum(axis=1).reshape(-1, *each.shape[2:])
            for each in (found.left, found.squares, found.inside)
        )
        size = np.sqrt(np.where(squares > 0.0, squares, 1.0))
        return self._solved(left / (size[:, :, None] * size[:, None, :]), inside / size[..., None])

    def _solved(self, left: Array, inside: Array) -> Gain:
        """Gain of shared columns from their products (grid, p, p) with each other and (grid, p, t) with the targets."""
        along = inside[..., 0]
        if self.targets.shape[-1] > 1:
            inner = np.linalg.pinv(self.gram[1:, 1:], rcond=1e-10, hermitian=True)
            left = left - inside[..., 1:] @ inner @ np.swapaxes(inside[..., 1:], -1, -2)
            along = along - inside[..., 1:] @ (inner @ self.gram[1:, 0])
        values, vectors = eigen(left)
        seen = values > SEEN**2
        onto = np.einsum("gpr,gp->gr", vectors, along)
        drop = np.sum(np.where(seen, onto**2 / np.where(seen, values, 1.0), 0.0), axis=1)
        rank = seen.sum(axis=1)
        return Gain(drop, rank, np.zeros((0, len(left))), drop, rank)
