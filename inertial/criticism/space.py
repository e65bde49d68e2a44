"""What a model leaves of the measurements, and how much a further effect would take: projections in the whitened space.

Blocks are the series that have coefficients of their own: one per unit and axis. Columns shared by all blocks (the station's
effects) are targets beside the measurements, so that adding a block's own column only updates a small Gram matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.noise import Basis

Array = NDArray[np.float64]

SEEN = 0.01
"""Share of a column, after the base model, below which the plan cannot see it (noise of the drivers makes as much)."""


@dataclass(frozen=True)
class Candidate:
    """Rotated columns of an effect at one or more values of its nonlinear parameters.

    columns : (blocks, n, grid, p), rotated by the basis
    shared : whether all blocks share the p coefficients
    """

    columns: Array
    shared: bool


@dataclass(frozen=True)
class Gain:
    """What a candidate takes off the sum of squares, per value of its nonlinear parameters.

    drop : (grid,), reduction of the whitened sum of squares
    rank : (grid,), number of coefficients that the plan determines
    by_block : (blocks, grid), reduction by block (zeros for shared candidates)
    """

    drop: Array
    rank: NDArray[np.intp]
    by_block: Array

    @staticmethod
    def joined(parts: Sequence["Gain"]) -> "Gain":
        """The gain over a grid that was worked on in parts."""
        if len(parts) == 1:
            return parts[0]
        return Gain(
            np.concatenate([p.drop for p in parts]),
            np.concatenate([p.rank for p in parts]),
            np.concatenate([p.by_block for p in parts], axis=1),
        )


class Space:
    """The measurements after a model, whitened at a share of wander.

    Parameters
    ----------
    basis : the rotation
    share : ρ, the wander's variance over the white one
    y : (blocks, n), rotated measurements
    local : (blocks, n, p), rotated columns with coefficients per block
    shared : (blocks, n, q), rotated columns with coefficients of all blocks
    """

    def __init__(self, basis: Basis, share: float, y: Array, local: Array, shared: Array) -> None:
        self.basis, self.share = basis, share
        self.spread = basis.spread(share)
        self.q = _orthonormal(local / self.spread[..., None])
        targets = np.concatenate([y[..., None], shared], axis=-1) / self.spread[..., None]
        self.targets = self.project(targets)
        self.gram = np.einsum("bnt,bns->ts", self.targets, self.targets)
        self.local_rank = self.q[1]
        self.shared_rank = int(np.linalg.matrix_rank(self.gram[1:, 1:], tol=None)) if shared.shape[-1] else 0

    @cached_property
    def rss(self) -> float:
        """Whitened sum of squares after the model."""
        return _schur(self.gram)

    @cached_property
    def dof(self) -> int:
        """Degrees of freedom of the residuals."""
        return self.basis.count - self.local_rank - self.shared_rank

    @cached_property
    def variance(self) -> float:
        """a: the factor by which the noise exceeds the white standard errors given, squared."""
        return self.rss / max(self.dof, 1)

    @cached_property
    def logdet(self) -> float:
        """Log-determinant of the covariance of all blocks, without the common factor a."""
        return float(np.sum(np.log(self.spread**2))) * (self.targets.shape[0] / self.spread.shape[0])

    @cached_property
    def residual(self) -> Array:
        """Whitened residuals, (blocks, n)."""
        if self.targets.shape[-1] == 1:
            return self.targets[..., 0]
        beta = np.linalg.lstsq(self.gram[1:, 1:], self.gram[1:, 0], rcond=None)[0]
        return self.targets[..., 0] - self.targets[..., 1:] @ beta

    def restricted(self, information: Array) -> float:
        """−2 log restricted likelihood, up to a constant, given log|XᵀV⁻¹X| of the model."""
        return self.dof * np.log(self.rss / max(self.dof, 1)) + self.logdet + float(np.sum(information))

    def project(self, columns: Array) -> Array:
        """Columns (blocks, n, m) less what the local columns explain."""
        q = self.q[0]
        return columns - q @ (np.swapaxes(q, -1, -2) @ columns)

    def gain(self, candidate: Candidate) -> Gain:
        """What a candidate explains of what is left."""
        blocks, n, grid, p = candidate.columns.shape
        flat = (candidate.columns / self.spread[..., None, None]).reshape(blocks, n, grid * p)
        size = np.sqrt(np.einsum("bnm,bnm->bm", flat, flat))
        left = self.project(flat)
        if candidate.shared:
            return self._gain_shared(left.reshape(blocks, n, grid, p), size.reshape(blocks, grid, p))
        safe = np.where(size > 0.0, size, 1.0)
        left = (left / safe[:, None, :]).reshape(blocks, n, grid, p)
        return self._gain_local(left)

    def _gain_local(self, left: Array) -> Gain:
        inside = np.einsum("bngp,bnt->bgpt", left, self.targets)
        if left.shape[-1] == 1:
            gram = np.einsum("bngp,bngp->bg", left, left)
            seen = gram > SEEN**2
            scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, gram, 1.0)), 0.0)
            along = (inside * scale[..., None, None])[:, :, 0, :]
            rank = seen.sum(axis=0)
            by_block = along[..., 0] ** 2
            taken = np.einsum("bgt,bgs->gts", along, along) if self.targets.shape[-1] > 1 else None
        else:
            gram = np.einsum("bngp,bngr->bgpr", left, left)
            values, vectors = np.linalg.eigh(gram)
            seen = values > SEEN**2
            scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
            along = np.einsum("bgpr,bgpt->bgrt", vectors, inside) * scale[..., None]
            rank = seen.sum(axis=(0, 2))
            by_block = np.einsum("bgr,bgr->bg", along[..., 0], along[..., 0])
            taken = np.einsum("bgrt,bgrs->gts", along, along) if self.targets.shape[-1] > 1 else None
        if taken is None:
            return Gain(by_block.sum(axis=0), rank, by_block)
        drop = np.array([self.rss - _schur(self.gram - t) for t in taken])
        return Gain(drop, rank, by_block)

    def _gain_shared(self, left: Array, size: Array) -> Gain:
        grid = left.shape[2]
        drop, rank = np.zeros(grid), np.zeros(grid, dtype=np.intp)
        total = np.sqrt(np.sum(size**2, axis=0))
        for g in range(grid):
            safe = np.where(total[g] > 0.0, total[g], 1.0)
            columns = left[:, :, g, :] / safe
            both = np.concatenate([self.targets, columns], axis=-1)
            gram = np.einsum("bnt,bns->ts", both, both)
            k = self.targets.shape[-1]
            own = gram[k:, k:]
            if k > 1:
                cross = gram[1:k, k:]
                own = own - cross.T @ np.linalg.lstsq(gram[1:k, 1:k], cross, rcond=None)[0]
            rank[g] = int(np.count_nonzero(np.linalg.eigvalsh(own) > SEEN**2))
            if rank[g]:
                drop[g] = self.rss - _schur(gram)
        return Gain(drop, rank, np.zeros((left.shape[0], grid)))


def information(local: Array, spread: Array) -> float:
    """log|XᵀV⁻¹X| summed over the blocks, for rotated columns (blocks, n, p)."""
    if local.shape[-1] == 0:
        return 0.0
    scaled = local / spread[..., None]
    size = np.sqrt(np.einsum("bnp,bnp->bp", scaled, scaled))
    safe = np.where(size > 0.0, size, 1.0)
    unit = scaled / safe[:, None, :]
    values = np.linalg.eigvalsh(np.swapaxes(unit, -1, -2) @ unit)
    return float(np.sum(np.log(np.maximum(values, SEEN**2))) + 2.0 * np.sum(np.log(safe)))


def _orthonormal(columns: Array) -> tuple[Array, int]:
    """Orthonormal bases (blocks, n, p) of what the columns span; directions below the tolerance are zeroed; total rank."""
    if columns.shape[-1] == 0:
        return columns, 0
    size = np.sqrt(np.einsum("bnp,bnp->bp", columns, columns))
    q = columns / np.where(size > 0.0, size, 1.0)[:, None, :]
    keep = np.ones((1, 1), dtype=bool)
    for tolerance in (1e-9, 0.5):  # the second turn removes what rounding left of the first
        values, vectors = np.linalg.eigh(np.swapaxes(q, -1, -2) @ q)
        keep = values > tolerance
        scale = np.where(keep, 1.0 / np.sqrt(np.where(keep, values, 1.0)), 0.0)
        q = q @ (vectors * scale[:, None, :])
    return q, int(keep.sum())


def _schur(gram: Array) -> float:
    """Sum of squares of the first target after the others."""
    if gram.shape[0] == 1:
        return float(gram[0, 0])
    size = np.sqrt(np.maximum(np.diag(gram)[1:], 1e-300))
    inner = gram[1:, 1:] / np.outer(size, size)
    cross = gram[1:, 0] / size
    return float(gram[0, 0] - cross @ np.linalg.lstsq(inner, cross, rcond=1e-8)[0])
