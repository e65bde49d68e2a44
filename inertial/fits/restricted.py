"""Restricted likelihood of a lot's series under white noise and two kinds of wander, on a whole grid of strengths at once.

For one share of the second kernel the covariance is B + s·K with B = W + t·K₂. With the vectors of K·x = λ·B·x every share s
only weighs: the whitened products of all columns are Σ xᵢ·xⱼ/(1 + s·λ), one matrix product for all shares and blocks. What
elimination leaves of the bordered matrix (H z)ᵀV⁻¹(H z) is ln|HᵀV⁻¹H| and the whitened sum of squares.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

Array = NDArray[np.float64]

_PIECE = 128
"""Blocks that are worked on together: large lots need memory for no more."""


class Restricted:
    """The likelihood of blocks with coefficients of their own and none in common.

    Parameters
    ----------
    h : (b, n, p), columns; z : (b, n), measurements in units of their white standard error
    white : (n, n), covariance of the white part; kernels : two covariances (n, n) of wander of variance one
    """

    def __init__(self, h: Array, z: Array, white: Array, kernels: tuple[Array, ...]) -> None:
        # what a plain fit explains is taken off first: the likelihood is the same, and its rounding that of the residuals
        plain = np.matmul(np.linalg.pinv(h), z[..., None])
        columns = np.concatenate([h, z[..., None] - np.matmul(h, plain)], axis=-1)
        self.blocks, self.n, self.width = columns.shape
        self._columns = np.moveaxis(columns, 0, 2)
        self._white, self._first, self._second = white, *kernels
        self._i, self._j = np.tril_indices(self.width)

    def on_grid(self, first: Array, second: Array) -> Array:
        """Restricted deviance, (k, l), for shares (k,) of the first kernel and (l,) of the second."""
        bases = [self._basis(share) for share in second.tolist()]
        weights = [1.0 / (1.0 + np.outer(first, values)) for values, _ in bases]
        # VᵀBV = 1: ln|B| = −2 ln|det V|
        volumes = [
            -2.0 * np.linalg.slogdet(vectors)[1] - np.log(weight).sum(axis=1)
            for (_, vectors), weight in zip(bases, weights, strict=True)
        ]
        squares, own = np.zeros((2, len(second), len(first)))
        for start in range(0, self.blocks, _PIECE):
            piece = np.ascontiguousarray(self._columns[..., start : start + _PIECE])
            rows = [self._products(piece, vectors, w) for (_, vectors), w in zip(bases, weights, strict=True)]
            pivots = self._pivots(np.stack(rows))
            squares += pivots[-1].sum(axis=-1)
            own += np.log(pivots[:-1]).sum(axis=(0, -1))
        dof = self.blocks * (self.n - self.width + 1)
        return (dof * np.log(np.maximum(squares / dof, 1e-300)) + self.blocks * np.stack(volumes) + own).T

    def _basis(self, share: float) -> tuple[Array, Array]:
        """λ (n,) and vectors (n, n) of K·x = λ·B·x at a share of the second kernel."""
        values, vectors = eigh(self._first, self._white + share * self._second, check_finite=False)
        return np.maximum(np.asarray(values, dtype=np.float64), 0.0), np.asarray(vectors, dtype=np.float64)

    def _products(self, piece: Array, vectors: Array, weight: Array) -> Array:
        """Products (k, pairs, b) of the columns (n, p + 1, b) of some blocks, weighted for every share."""
        rotated = (vectors.T @ piece.reshape(self.n, -1)).reshape(piece.shape)
        pairs = np.empty((self.n, len(self._i), piece.shape[-1]))
        for column in range(
            self.width
        ):  # in the order of the lower triangle; picking pairs by index takes six times as long
            first = column * (column + 1) // 2
            own = pairs[:, first : first + column + 1]
            np.multiply(rotated[:, column : column + 1], rotated[:, : column + 1], out=own)
        return (weight @ pairs.reshape(self.n, -1)).reshape(len(weight), len(self._i), -1)

    def _pivots(self, products: Array) -> Array:
        """Pivots (p + 1, l, k, b) of Gaussian elimination of every bordered matrix, the measurements last."""
        matrix = np.empty((self.width, self.width, *products.shape[:2], products.shape[-1]))
        matrix[self._i, self._j] = np.moveaxis(products, 2, 0)
        for column in range(self.width - 1):
            below = matrix[column + 1 :, column]
            ratio = below / matrix[column, column]
            for row in range(len(below)):
                matrix[column + 1 + row, column + 1 : column + 2 + row] -= ratio[row] * below[: row + 1]
        return matrix[np.arange(self.width), np.arange(self.width)]
