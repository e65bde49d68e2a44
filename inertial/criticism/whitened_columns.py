"""The columns of a model and the measurements, whitened for the search of the noise's shares."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.covariance import LARGE
from inertial.criticism.noise_shares import Shares
from inertial.criticism.problem import Problem

Array = NDArray[np.float64]

_HANGING = 1e-3
"""Independent part of a column below which a single factorisation is inaccurate."""

VANISHING = 3e-5
"""Singular value of columns of unit length, over the largest, below which a combination of them vanishes."""

_KEPT = 2_000_000
"""Largest number of whitened values kept for models with one more term."""


class WhitenedColumns:
    """Columns with coefficients by block, and the measurements behind them.

    Parameters
    ----------
    local : (blocks, n, p), columns, g per unit of the coefficient
    before : those of a model without its last term, which are whitened once for all that follow it; None without one
    further : (blocks, n, k), columns of the last term
    """

    def __init__(
        self, problem: Problem, local: Array, before: "WhitenedColumns | None" = None, further: Array | None = None
    ) -> None:
        self.problem, self.local = problem, local
        self.whole = self._determined is local
        # a combination that vanishes mixes the columns: then all are whitened together
        nested = before is not None and further is not None and self.whole and before.whole and problem.y.size <= LARGE
        self._before = before if nested else None
        self._further = self._unit(further) if nested and further is not None else None
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
        unit = self.local * self.problem.covariance.there[..., None]
        size = np.linalg.norm(unit, axis=1)
        unit = unit / np.where(size > 0.0, size, 1.0)[:, None, :]
        _, values, turn = np.linalg.svd(unit, full_matrices=False)
        if not values.size:
            return self.local
        ranks = np.sum(values > VANISHING * values[:, :1], axis=1)
        rank = int(ranks.max())
        if rank == self.local.shape[-1] or int(ranks.min()) != rank:
            return self.local
        scaled = self.local / np.where(size > 0.0, size, 1.0)[:, None, :]
        return scaled @ np.swapaxes(turn[:, :rank], -1, -2)

    @cached_property
    def _sizes(self) -> Array:
        """Sizes of the determined columns, (blocks, r)."""
        return self._size_of(self._determined)

    def _size_of(self, columns: Array) -> Array:
        own = columns * self.problem.covariance.there[..., None]
        size = np.sqrt(np.einsum("bnp,bnp->bp", own, own))
        return np.where(size > 0.0, size, 1.0)

    def _unit(self, columns: Array) -> Array:
        return columns / self._size_of(columns)[:, None, :]

    def _plain(self) -> Array:
        """Determined columns, of unit size, and the measurements behind them, (blocks, n, r + 1)."""
        return np.concatenate([self._unit(self._determined), self.problem.y[..., None]], axis=-1)

    @cached_property
    def _stored(self) -> Array:
        """The same, kept for all shares that are tried; not for large lots."""
        return self._plain()

    def at(self, shares: Shares, *, keep: bool = False) -> Array:
        """Determined columns, of unit size, and the measurements behind them, whitened, (blocks, n, r + 1)."""
        kept = self._kept.get(shares)
        if kept is None:
            whiten = self.problem.covariance.whiten
            if self._before is None or self._further is None:
                kept = whiten(self._plain() if self.problem.y.size > LARGE else self._stored, shares)
            else:
                own = self._before.at(shares, keep=True)
                kept = np.concatenate([own[..., :-1], whiten(self._further, shares), own[..., -1:]], axis=-1)
            if keep:
                while len(self._kept) >= max(2, _KEPT // kept.size):
                    del self._kept[next(iter(self._kept))]
                self._kept[shares] = kept
        return kept

    def at_once(self, shares: Shares) -> tuple[float, Array] | None:
        """log|HᵀV⁻¹H|, up to a constant, and sums of squares (blocks,), by one factorisation; None if columns are collinear."""
        white = self.at(shares)
        gram = np.swapaxes(white, -1, -2) @ white
        size = np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-300))
        try:
            root = np.linalg.cholesky(gram / (size[:, :, None] * size[:, None, :]))
        except np.linalg.LinAlgError:
            return None
        diagonal = np.diagonal(root, axis1=-2, axis2=-1)
        if float(diagonal[:, :-1].min(initial=1.0)) < _HANGING:
            return None
        information = 2.0 * float(np.sum(np.log(diagonal[:, :-1] * size[:, :-1])))
        information += 2.0 * float(np.sum(np.log(self._sizes)))
        return information, np.asarray((diagonal[:, -1] * size[:, -1]) ** 2, dtype=np.float64)
