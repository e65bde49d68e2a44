"""Residuals of a model and their reduction by a further effect: projections in the whitened space.

Blocks are the series with their own coefficients: one per unit and axis. Columns shared by all blocks (the station's
effects) are targets beside the measurements, so that adding a block's own column only updates a small Gram matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.covariance import Covariance
from inertial.criticism.noise_shares import Noise

Array = NDArray[np.float64]

_PIECE = 1_000_000
"""Largest number of columns' values that are worked on at a time, of candidates whose whitened columns are not stored."""

SEEN = 0.01
"""Share of a column, after the base model, below which it is not visible (noise of the drivers has this size)."""


@dataclass(frozen=True)
class Candidate:
    """Columns of an effect at one or more values of its nonlinear parameters.

    columns : (blocks, n, grid, p), g per unit of the coefficient
    shared : whether all blocks share the p coefficients
    blocks : the blocks that the columns are of, all if None; the columns of the others are zero. Only where shared
    key : under which whitened columns are stored; not stored if None
    distinct : how many blocks, the first, have columns of their own, which the others repeat in turn; all if None
    """

    columns: Array
    shared: bool
    blocks: NDArray[np.intp] | None = None
    key: object = None
    distinct: int | None = None

    def whitened(self, covariance: Covariance, noise: Noise) -> Array:
        """The columns in the whitened space, (blocks, n, grid, p)."""
        blocks, n, grid, p = self.columns.shape
        flat = self.columns.reshape(blocks, n, grid * p)
        if self.key is None:
            white = covariance.whiten(flat, noise.shares, self.blocks)
        else:
            white = covariance.whitened(self.key, flat, noise.shares, self.blocks, distinct=self.distinct)
        scale = noise.scale if self.blocks is None else noise.scale[self.blocks]
        return (white / scale[:, None, None]).reshape(blocks, n, grid, p)


@dataclass(frozen=True)
class Gain:
    """Reduction of the sum of squares by a candidate, per value of its nonlinear parameters.

    drop : (grid,), reduction of the whitened sum of squares
    rank : (grid,), number of coefficients that the plan determines
    by_block : (blocks, grid), reduction by block (zeros for shared candidates)
    """

    drop: Array
    rank: NDArray[np.intp]
    by_block: Array

    @staticmethod
    def joined(parts: Sequence["Gain"]) -> "Gain":
        """The gain over a grid that was processed in parts."""
        if len(parts) == 1:
            return parts[0]
        return Gain(
            np.concatenate([p.drop for p in parts]),
            np.concatenate([p.rank for p in parts]),
            np.concatenate([p.by_block for p in parts], axis=1),
        )


class Space:
    """The measurements after a model, whitened for its noise: of variance one if the model is correct.

    Parameters
    ----------
    y : (blocks, n), measurements, g
    local : (blocks, n, p), columns with coefficients per block
    shared : (blocks, n, q), columns with coefficients of all blocks
    """

    def __init__(self, covariance: Covariance, noise: Noise, y: Array, local: Array, shared: Array) -> None:
        self.covariance, self.noise = covariance, noise
        white = self.whiten(np.concatenate([y[..., None], shared, local], axis=-1))
        self.local = white[..., 1 + shared.shape[-1] :]
        self.q, self.ranks = _orthonormal(self.local)
        self.targets = self.project(white[..., : 1 + shared.shape[-1]])
        self.gram = np.einsum("bnt,bns->ts", self.targets, self.targets)
        self.local_rank = int(self.ranks.sum())
        self.shared_rank = int(np.linalg.matrix_rank(self.gram[1:, 1:], tol=None)) if shared.shape[-1] else 0

    def whiten(self, columns: Array) -> Array:
        """Columns (blocks, n, m) in this space."""
        return self.covariance.whiten(columns, self.noise.shares) / self.noise.scale[:, None, None]

    @cached_property
    def rss(self) -> float:
        """Whitened sum of squares after the model."""
        return _schur(self.gram)

    @cached_property
    def dof(self) -> int:
        """Degrees of freedom of the residuals."""
        return int(self.covariance.count.sum()) - self.local_rank - self.shared_rank

    @cached_property
    def by_block(self) -> Array:
        """Degrees of freedom of each block, (blocks,)."""
        return np.maximum(self.covariance.count - self.ranks, 0).astype(np.float64)

    @cached_property
    def squares(self) -> Array:
        """Sums of squares of each block over its white variance, (blocks,): the scale is not removed."""
        return np.einsum("bn,bn->b", self.residual, self.residual) * self.noise.scale**2

    @cached_property
    def variance(self) -> float:
        """Mean square of the residuals: one if the noise is that of this model."""
        return self.rss / max(self.dof, 1)

    @cached_property
    def logdet(self) -> float:
        """Log-determinant of the covariance of all blocks, scales apart."""
        return float(np.sum(self.covariance.logdet(self.noise.shares)))

    @cached_property
    def residual(self) -> Array:
        """Whitened residuals, (blocks, n)."""
        if self.targets.shape[-1] == 1:
            return self.targets[..., 0]
        beta = np.linalg.lstsq(self.gram[1:, 1:], self.gram[1:, 0], rcond=None)[0]
        return self.targets[..., 0] - self.targets[..., 1:] @ beta

    @cached_property
    def information(self) -> float:
        """log|HᵀV⁻¹H| of the local columns over all blocks, scales apart."""
        if self.local.shape[-1] == 0:
            return 0.0
        columns = self.local * self.noise.scale[:, None, None]
        size = np.sqrt(np.einsum("bnp,bnp->bp", columns, columns))
        safe = np.where(size > 0.0, size, 1.0)
        unit = columns / safe[:, None, :]
        values = np.linalg.eigvalsh(np.swapaxes(unit, -1, -2) @ unit)
        return float(np.sum(np.log(np.maximum(values, SEEN**2))) + 2.0 * np.sum(np.log(safe)))

    def project(self, columns: Array, blocks: NDArray[np.intp] | None = None) -> Array:
        """Whitened columns (blocks, n, m) without the part that the local columns explain."""
        q = self.q if blocks is None else self.q[blocks]
        return columns - q @ (np.swapaxes(q, -1, -2) @ columns)

    def gain(self, candidate: Candidate) -> Gain:
        """Gain of a candidate on the residuals."""
        if candidate.shared or candidate.key is not None or candidate.columns.size <= _PIECE:
            return self._gain_at_once(candidate)
        # some blocks at a time: every step makes several arrays of the size of their columns
        few = max(_PIECE // max(candidate.columns[0].size, 1), 1)
        whole = np.arange(len(candidate.columns))
        parts = [self._part(candidate.columns[b], b) for b in np.split(whole, whole[few::few])]
        along, seen = (np.concatenate(each) for each in zip(*parts, strict=True))
        return self._gain_along(along, seen)

    def _part(self, columns: Array, blocks: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
        """Targets along the directions of the columns (b, n, grid, p) of some blocks."""
        white, left = self.whitened(columns, blocks)
        size = np.sqrt(np.einsum("bngp,bngp->bgp", white, white))[:, None]
        return self._along(left.reshape(columns.shape) / np.where(size > 0.0, size, 1.0), self.targets[blocks])

    def _gain_at_once(self, candidate: Candidate) -> Gain:
        white = candidate.whitened(self.covariance, self.noise)
        blocks, n, grid, p = white.shape
        flat = white.reshape(blocks, n, grid * p)
        size = np.sqrt(np.einsum("bnm,bnm->bm", flat, flat))
        left = self.project(flat, candidate.blocks)
        if candidate.shared:
            rows = slice(None) if candidate.blocks is None else candidate.blocks
            return self._gain_shared(
                left.reshape(blocks, n, grid, p), size.reshape(blocks, grid, p), self.targets[rows]
            )
        safe = np.where(size > 0.0, size, 1.0)
        left = (left / safe[:, None, :]).reshape(blocks, n, grid, p)
        return self._gain_local(left)

    def gain_of_dwells(self, columns: Array, places: NDArray[np.intp]) -> Gain:
        """Gain of columns of one dwell each, for every dwell separately; all blocks share their coefficients.

        With P as in :mod:`inertial.criticism.left_out` a column t at dwell k has the product t²·P_kk with itself and t·(Py)_k
        with the measurements: no column is whitened.

        Parameters
        ----------
        columns : (blocks, n, p), of every dwell; places : (grid,), the dwells
        """
        blocks, n, p = columns.shape
        inside, own = np.zeros((n, p, self.targets.shape[-1])), np.zeros((n, p, p))
        size = np.zeros((n, p))
        for members, whitener in self.covariance.whiteners(self.noise.shares):
            scale = (self.covariance.level * self.noise.scale)[members, None]
            # rows of Pᵀ from the left: the part that the local columns explain is subtracted
            back = np.swapaxes(self.targets[members], -1, -2) @ whitener
            along = np.swapaxes(self.q[members], -1, -2) @ whitener
            whole = np.sum(whitener**2, axis=0) / scale**2
            diagonal = np.maximum(whole - np.einsum("brn,brn->bn", along, along) / scale**2, 0.0)
            inside += np.einsum("bnp,btn->npt", columns[members], back / scale[..., None])
            own += np.einsum("bnp,bnr,bn->npr", columns[members], columns[members], diagonal)
            size += np.einsum("bnp,bn->np", columns[members] ** 2, whole)
        size = np.sqrt(np.where(size > 0.0, size, 1.0))
        return self._solved(
            (own / size[:, :, None] / size[:, None, :])[places], (inside / size[..., None])[places], blocks
        )

    def whitened(self, columns: Array, blocks: NDArray[np.intp]) -> tuple[Array, Array]:
        """Columns (b, n, grid, p) of some blocks in this space, and (b, n, grid·p) after the local columns."""
        flat = columns.reshape(*columns.shape[:2], -1)
        white = self.covariance.whiten(flat, self.noise.shares, blocks) / self.noise.scale[blocks, None, None]
        return white.reshape(columns.shape), self.project(white, blocks)

    def _gain_local(self, left: Array) -> Gain:
        return self._gain_along(*self._along(left, self.targets))

    @staticmethod
    def _along(left: Array, targets: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Targets (b, n, t) along the directions of columns (b, n, grid, p), (b, grid, p, t); which directions are seen."""
        inside = np.einsum("bngp,bnt->bgpt", left, targets)
        if left.shape[-1] == 1:
            gram = np.einsum("bngp,bngp->bg", left, left)
            seen = gram > SEEN**2
            scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, gram, 1.0)), 0.0)
            return inside * scale[..., None, None], seen[..., None]
        gram = np.einsum("bngp,bngr->bgpr", left, left)
        values, vectors = np.linalg.eigh(gram)
        seen = values > SEEN**2
        scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
        return np.einsum("bgpr,bgpt->bgrt", vectors, inside) * scale[..., None], seen

    def _gain_along(self, along: Array, seen: NDArray[np.bool_]) -> Gain:
        rank = seen.sum(axis=(0, 2))
        by_block = np.einsum("bgr,bgr->bg", along[..., 0], along[..., 0])
        if self.targets.shape[-1] == 1:
            return Gain(by_block.sum(axis=0), rank, by_block)
        taken = np.einsum("bgrt,bgrs->gts", along, along)
        drop = np.array([self.rss - _schur(self.gram - t) for t in taken])
        return Gain(drop, rank, by_block)

    def _gain_shared(self, left: Array, size: Array, targets: Array) -> Gain:
        """Gain of columns with common coefficients: all values of the grid at once."""
        blocks, n, grid, p = left.shape
        total = np.sqrt(np.sum(size**2, axis=0))
        columns = left / np.where(total > 0.0, total, 1.0)
        by_value = columns.transpose(2, 3, 0, 1).reshape(grid, p, blocks * n)
        own = by_value @ np.swapaxes(by_value, -1, -2)
        inside = by_value @ targets.reshape(blocks * n, -1)  # (grid, p, t)
        return self._solved(own, inside, self.targets.shape[0])

    def _solved(self, own: Array, inside: Array, blocks: int) -> Gain:
        """Gain from products (grid, p, p) of common columns with each other and (grid, p, t) with the targets."""
        along = inside[..., 0]
        if self.targets.shape[-1] > 1:
            inner = np.linalg.pinv(self.gram[1:, 1:], rcond=1e-10, hermitian=True)
            own = own - inside[..., 1:] @ inner @ np.swapaxes(inside[..., 1:], -1, -2)
            along = along - inside[..., 1:] @ (inner @ self.gram[1:, 0])
        values, vectors = np.linalg.eigh(own)
        seen = values > SEEN**2
        onto = np.einsum("gpr,gp->gr", vectors, along)
        drop = np.sum(np.where(seen, onto**2 / np.where(seen, values, 1.0), 0.0), axis=1)
        return Gain(drop, seen.sum(axis=1), np.zeros((blocks, len(own))))


def _orthonormal(columns: Array) -> tuple[Array, NDArray[np.intp]]:
    """Orthonormal bases (blocks, n, p) of what the columns span, directions below the tolerance zeroed; ranks (blocks,)."""
    if columns.shape[-1] == 0:
        return columns, np.zeros(len(columns), dtype=np.intp)
    size = np.sqrt(np.einsum("bnp,bnp->bp", columns, columns))
    q = columns / np.where(size > 0.0, size, 1.0)[:, None, :]
    keep = np.ones((1, 1), dtype=bool)
    for tolerance in (1e-9, 0.5):  # the second turn removes rounding errors of the first
        values, vectors = np.linalg.eigh(np.swapaxes(q, -1, -2) @ q)
        keep = values > tolerance
        scale = np.where(keep, 1.0 / np.sqrt(np.where(keep, values, 1.0)), 0.0)
        q = q @ (vectors * scale[:, None, :])
    return q, keep.sum(axis=-1)


def _schur(gram: Array) -> float:
    """Sum of squares of the first target after the others."""
    if gram.shape[0] == 1:
        return float(gram[0, 0])
    size = np.sqrt(np.maximum(np.diag(gram)[1:], 1e-300))
    inner = gram[1:, 1:] / np.outer(size, size)
    cross = gram[1:, 0] / size
    return float(gram[0, 0] - cross @ np.linalg.lstsq(inner, cross, rcond=1e-8)[0])
