"""Restricted likelihood of a lot's series under white noise and two kinds of wander, on a whole grid of strengths at once.

The covariance is W + t·K₂ + s·K₁. Columns that all blocks have in common (the poses are those of the table) are taken out once,
by contrasts R with R·H = 0 and R·W·Rᵀ = 1, turned so that R·K₂·Rᵀ = Λ: the remaining block is smaller. For one
share t the vectors of D·R·K₁·Rᵀ·D with D = (1 + t·Λ)^(−1/2) make all shares s diagonal: the whitened products of all
columns are Σ xᵢ·xⱼ/(1 + s·λ), one matrix product for all shares and blocks. What elimination leaves of the bordered matrix
(H z)ᵀV⁻¹(H z) is ln|HᵀV⁻¹H| and the whitened sum of squares.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Array = NDArray[np.float64]

_PIECE = 128
"""Blocks that are worked on together: large lots need memory for no more."""


def profiled_deviance(variance: Array | float, dof: int) -> Array:
    """ν·ln s² + ν·(v/s² − 1) of a mean square v of ν degrees of freedom, at the variance s² of the white part that is likeliest.

    Measurements are in units of their white standard error, which the scatter of the samples shows: s² is no less than one. Left
    free, flicker took the white part's place: in 20 lots with B 30 µg its share came out ten thousand times too large, and the
    fit took part of it for a random walk that was not there.
    """
    likely = np.maximum(variance, 1.0)
    return dof * (np.log(likely) + variance / likely - 1.0)


class Restricted:
    """The likelihood of blocks with coefficients of their own and none in common.

    Parameters
    ----------
    h : (b, n, p), columns; z : (b, n), measurements in units of their white standard error
    white : (n, n), covariance of the white part; kernels : two covariances (n, n) of wander of variance one
    """

    def __init__(self, h: Array, z: Array, white: Array, kernels: tuple[Array, ...]) -> None:
        common, own = _common(h)
        root: Array = np.linalg.cholesky(white).astype(np.float64)
        turn, triangle = np.linalg.qr(_solved(root, common), mode="complete")
        contrasts = _solved(root, turn[:, common.shape[-1] :], transposed=True).T
        values, vectors = np.linalg.eigh(contrasts @ kernels[1] @ contrasts.T)
        self._second, contrasts = np.maximum(values, 0.0), vectors.T @ contrasts
        self._first = contrasts @ kernels[0] @ contrasts.T
        # ln|V| + ln|HᵀV⁻¹H| = ln|R·V·Rᵀ| + a constant, with the columns H that are taken out
        self._volume = 2.0 * (_log_sizes(root) + _log_sizes(triangle.astype(np.float64)))
        self.blocks, self.n, p = h.shape
        self.width = own.shape[-1] + 1
        self._dof = self.blocks * (self.n - p)
        # what a plain fit explains is taken off first: the likelihood is the same, and its rounding that of the residuals
        columns = np.concatenate([own, _left(h, z)[..., None]], axis=-1)
        self._columns = (contrasts @ np.moveaxis(columns, 0, 2).reshape(self.n, -1)).reshape(
            -1, self.width, self.blocks
        )
        self._i, self._j = np.tril_indices(self.width)
        self._bases: dict[float, tuple[Array, Array, float]] = {}

    def on_grid(self, first: Array, second: Array) -> Array:
        """Restricted deviance, (k, l), for shares (k,) of the first kernel and (l,) of the second."""
        bases = [self._basis(share) for share in second.tolist()]
        weights = [1.0 / (1.0 + np.outer(first, values)) for values, _, _ in bases]
        volumes = np.stack([one - np.log(weight).sum(axis=1) for (*_, one), weight in zip(bases, weights, strict=True)])
        squares, own = np.zeros((2, len(second), len(first)))
        for start in range(0, self.blocks, _PIECE):
            piece = np.ascontiguousarray(self._columns[..., start : start + _PIECE])
            rows = [self._products(piece, turn, weight) for (_, turn, _), weight in zip(bases, weights, strict=True)]
            pivots = self._pivots(rows)
            squares += pivots[-1].sum(axis=-1)
            own += np.log(pivots[:-1]).sum(axis=(0, -1))
        return (profiled_deviance(squares / self._dof, self._dof) + self.blocks * volumes + own).T

    def _basis(self, share: float) -> tuple[Array, Array, float]:
        """At a share of the second kernel λ (m,) of the first, the turn (m, m) to its vectors, and ln|W + t·K₂|.

        Kept, since the grids of one likelihood share some of their strengths.
        """
        if share not in self._bases:
            self._bases[share] = self._basis_at(share)
        return self._bases[share]

    def _basis_at(self, share: float) -> tuple[Array, Array, float]:
        shrink = 1.0 / np.sqrt(1.0 + share * self._second)
        values, vectors = np.linalg.eigh(shrink[:, None] * self._first * shrink)
        return np.maximum(values, 0.0), (shrink[:, None] * vectors).T, self._volume - 2.0 * float(np.log(shrink).sum())

    def _products(self, piece: Array, turn: Array, weight: Array) -> Array:
        """Products (k, pairs, b) of the columns (m, p + 1, b) of some blocks, weighted for every share."""
        rotated = (turn @ piece.reshape(len(piece), -1)).reshape(piece.shape)
        pairs = np.empty((len(piece), len(self._i), piece.shape[-1]))
        # in the order of the lower triangle; picking pairs by index takes six times as long
        for column in range(self.width):
            first = column * (column + 1) // 2
            own = pairs[:, first : first + column + 1]
            np.multiply(rotated[:, column : column + 1], rotated[:, : column + 1], out=own)
        return (weight @ pairs.reshape(len(piece), -1)).reshape(len(weight), len(self._i), -1)

    def _pivots(self, products: list[Array]) -> Array:
        """Pivots (p + 1, l, k, b) of Gaussian elimination of every bordered matrix, the measurements last."""
        shape = (len(products), len(products[0]), products[0].shape[-1])
        matrix = np.empty((self.width, self.width, *shape))
        matrix[self._i, self._j] = np.moveaxis(np.stack(products), 2, 0)
        for column in range(self.width - 1):
            below = matrix[column + 1 :, column]
            ratio = below / matrix[column, column]
            for row in range(len(below)):
                matrix[column + 1 + row, column + 1 : column + 2 + row] -= ratio[row] * below[: row + 1]
        return matrix[np.arange(self.width), np.arange(self.width)]


def _common(h: Array) -> tuple[Array, Array]:
    """Columns (n, c) that every block has, wherever they stand in it, and the others of each block, (b, n, p − c)."""
    kept = np.ones((h.shape[0], h.shape[2]), dtype=bool)
    common: list[Array] = []
    blocks = np.arange(len(h))
    for column in h[0].T:
        same = np.all(h == column[:, None], axis=1) & kept
        if same.any(axis=1).all():
            kept[blocks, same.argmax(axis=1)] = False
            common.append(column)
    own = np.swapaxes(np.swapaxes(h, 1, 2)[kept].reshape(len(h), -1, h.shape[1]), 1, 2)
    return np.stack(common, axis=1) if common else np.zeros((h.shape[1], 0)), own


def _left(h: Array, z: Array) -> Array:
    """What plain least squares leaves of the measurements, (b, n)."""
    basis = np.linalg.qr(h)[0]
    return z - np.matmul(basis, np.matmul(np.swapaxes(basis, -1, -2), z[..., None]))[..., 0]


def _solved(root: Array, columns: Array, *, transposed: bool = False) -> Array:
    """Columns with the lower triangular ``root`` (n, n), or its transpose, divided off from the left."""
    return np.asarray(solve_triangular(root, columns, lower=True, trans=int(transposed)), dtype=np.float64)


def _log_sizes(triangle: Array) -> float:
    """Logarithm of the determinant of a triangular matrix, less its sign."""
    return float(np.log(np.abs(np.diagonal(triangle))).sum())
