"""Generalised least squares of a lot's series under white noise and wander, with the strengths from the series themselves.

Blocks are the series of one unit and axis, each with coefficients of its own; further columns may have coefficients that all
blocks share. All series are in units of their white standard error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import solve_triangular

from inertial.arrays import Array, Flags, Index

_STEP = 10.0
SHARES = (0.0, *(0.1 * _STEP ** np.arange(7)).tolist())
_FINE = 12
_FAR = 12.0
"""Deviance above the lowest at which a pair of shares is out of the question."""
_CHARGE = 4.0
"""Deviance that wander must be worth to be believed."""
_SINGULAR = 1e-12
"""Share of the largest below which a combination of shared parameters is not determined, and has no step."""


@dataclass(frozen=True)
class Solved:
    """Coefficients at given shares of wander.

    theta : (..., 3, p); inverse : (..., 3, p, p), their covariance over the variance
    gain : (..., 3, p, n), derivative of the coefficients by every value of a series
    shared : (q,); shared_inverse : (q, q), likewise
    squares : (..., 3), whitened sums of squares; variance : of the white part; deviance : −2 log restricted likelihood
    """

    theta: Array
    inverse: Array
    gain: Array
    shared: Array
    shared_inverse: Array
    squares: Array
    variance: float
    deviance: float


class Series:
    """The series of a lot; ``dof`` (..., 3) has the degrees of freedom of each.

    Parameters
    ----------
    h : (..., 3, n, p), columns with coefficients by block
    s : (..., 3, n, q), columns with coefficients of all blocks
    z : (..., 3, n), measurements
    profile : (n,), white standard deviation of each dwell, about one
    kernels : covariances (n, n) of the kinds of wander, of variance one
    missing : (..., n), measurements that a block lacks, with any finite value; None where all have all. One further coefficient
        for each of them takes it out of coefficients, squares and restricted likelihood exactly
    """

    def __init__(
        self,
        h: Array,
        s: Array,
        z: Array,
        profile: Array,
        kernels: tuple[Array, ...],
        missing: Flags | None = None,
    ) -> None:
        self._width = h.shape[-1]
        lacking = 0 if missing is None else np.count_nonzero(missing, axis=-1)[..., None]
        self.dof: Index = np.broadcast_to(h.shape[-2] - h.shape[-1] - lacking, z.shape[:-1]).astype(np.int64)
        self._gaps = missing is not None and bool(missing.any())
        if missing is not None and self._gaps:
            h = np.concatenate([np.broadcast_to(h, (*z.shape, self._width)), _indicators(missing, z.shape)], axis=-1)
        scale = np.sqrt(np.mean(h**2, axis=-2, keepdims=True))
        self._scale = np.where(scale > 0.0, scale, 1.0)
        self._h, self._z, self.kernels = h / self._scale, z, kernels
        size = np.sqrt(np.mean(s**2, axis=tuple(range(s.ndim - 1))))
        self._size = np.where(size > 0.0, size, 1.0)
        self._s = s / self._size
        self.white = np.diag(profile**2)
        self.sound = np.ones(z.shape[:-1], dtype=bool)
        self._grids: dict[bytes, Restricted] = {}

    def covariance(self, shares: Sequence[float]) -> Array:
        """Covariance (n, n) of a series over the variance of its white part."""
        return self.white + sum(share * kernel for share, kernel in zip(shares, self.kernels, strict=True))

    def solve(self, shares: Sequence[float]) -> Solved:
        """Coefficients, their covariance and the restricted deviance at shares of the kernels."""
        root = np.asarray(np.linalg.cholesky(self.covariance(shares)), dtype=np.float64)
        whiten = solve_triangular(root, np.eye(len(root)), lower=True)
        h = np.matmul(whiten, self._h)
        gram = np.swapaxes(h, -1, -2) @ h
        if self._gaps:  # blocks with fewer gaps than others have columns of zeros
            empty = np.diagonal(gram, axis1=-2, axis2=-1) == 0.0
            gram = gram + np.where(empty, 1.0, 0.0)[..., None] * np.eye(gram.shape[-1])
        inverse = np.linalg.inv(gram)
        gain = inverse @ np.swapaxes(h, -1, -2)
        z = np.matmul(self._z, whiten.T)
        shared, shared_inverse = np.zeros(0), np.zeros((0, 0))
        if self._s.shape[-1]:
            s = np.matmul(whiten, self._s)
            free = (s - np.matmul(h, gain @ s)).reshape(-1, s.shape[-1])
            shared_inverse = np.asarray(np.linalg.pinv(free.T @ free, rcond=_SINGULAR, hermitian=True))
            shared = shared_inverse @ (free.T @ z.reshape(-1))
            z = z - s @ shared
        theta = np.matmul(gain, z[..., None])[..., 0]
        squares = np.sum((z - np.matmul(h, theta[..., None])[..., 0]) ** 2, axis=-1)
        variance, deviance = self._restricted(squares, root, gram, shared_inverse)
        width = self._width
        size = self._scale[..., 0, :width]
        return Solved(
            theta=theta[..., :width] / size,
            inverse=inverse[..., :width, :width] / (size[..., :, None] * size[..., None, :]),
            gain=(gain[..., :width, :] @ whiten) / size[..., None],
            shared=shared / self._size,
            shared_inverse=shared_inverse / np.outer(self._size, self._size),
            squares=squares,
            variance=variance,
            deviance=deviance,
        )

    def _restricted(self, squares: Array, root: Array, gram: Array, shared_inverse: Array) -> tuple[float, float]:
        """Variance of the white part and restricted deviance of the sound blocks."""
        blocks = int(self.sound.sum())
        dof = int(self.dof[self.sound].sum()) - len(shared_inverse)
        variance = float(np.sum(squares[self.sound])) / dof
        logdet = np.broadcast_to(np.linalg.slogdet(gram)[1], squares.shape)[self.sound].sum()
        if len(shared_inverse):
            sizes = np.linalg.eigvalsh(shared_inverse)
            logdet -= np.sum(np.log(sizes[sizes > _SINGULAR * sizes[-1]]))
        deviance = float(profiled_deviance(variance, dof)) + 2.0 * blocks * np.sum(np.log(np.diagonal(root))) + logdet
        return variance, float(deviance)

    def deviances(self, first: Array, second: Array) -> Array:
        """Restricted deviance of the sound blocks, (k, l), for shares (k,) of the first kernel and (l,) of the second."""
        if self._s.shape[-1] or self._gaps:
            grid = [self.solve(pair).deviance for pair in product(first.tolist(), second.tolist())]
            return np.reshape(grid, (len(first), len(second)))
        blocks = self.sound.tobytes()
        if blocks not in self._grids:
            h = np.broadcast_to(self._h, (*self._z.shape, self._h.shape[-1]))
            self._grids = {blocks: Restricted(h[self.sound], self._z[self.sound], self.white, self.kernels)}
        return self._grids[blocks].on_grid(first, second)

    def best_shares(self) -> tuple[float, float]:
        """Shares of flicker and walk: their mean over the restricted likelihood; zero where the lot shows no wander.

        A slow drift within one record may be either, and the likelihood is flat between the two: its peak jumps from one
        answer to the other, its mean does not.
        """
        shares = np.array(SHARES)
        coarse = self.deviances(shares, shares)
        if coarse[0, 0] - coarse.min() < _CHARGE:
            return 0.0, 0.0
        rows, columns = np.nonzero(coarse - coarse.min() < _FAR)
        flicker, walk = (_around(shares[points]) for points in (rows, columns))
        deviance = self.deviances(flicker**2, walk**2)
        rows, columns = np.nonzero(deviance - deviance.min() < _FAR)
        flicker, walk = _between(flicker[rows] ** 2), _between(walk[columns] ** 2)
        deviance = self.deviances(flicker**2, walk**2)
        # half of the belief beforehand is that a kind of wander is not there at all
        belief = np.outer(*(np.where(root > 0.0, 1.0, _FINE - 1.0) for root in (flicker, walk)))
        weight = belief * np.exp(-0.5 * (deviance - deviance.min()))
        weight = weight / weight.sum()
        return float(weight.sum(axis=1) @ flicker**2), float(weight.sum(axis=0) @ walk**2)


def _indicators(missing: Flags, shape: tuple[int, ...]) -> Array:
    """Columns (..., 3, n, k), each 1 at one gap of the block; columns of zeros where a block has fewer than k gaps."""
    gap = np.cumsum(missing, axis=-1) - 1
    columns = (gap[..., None] == np.arange(int(gap.max()) + 1)) & missing[..., None]
    return np.broadcast_to(columns[..., None, :, :], (*shape, columns.shape[-1])).astype(np.float64)


def _around(shares: Array) -> Array:
    """Standard deviations (_FINE,) to look at, one coarse step beyond those that are likely."""
    low, high = float(shares.min()) / _STEP, max(float(shares.max()), SHARES[1]) * _STEP
    return np.linspace(low**0.5, high**0.5, _FINE)


def _between(shares: Array) -> Array:
    """Standard deviations (_FINE,) from the least to the largest of the shares."""
    return np.linspace(float(shares.min()) ** 0.5, float(shares.max()) ** 0.5, _FINE)


_PIECE = 128
"""Blocks that are worked on together: large lots need memory for no more."""


def profiled_deviance(variance: Array | float, dof: int) -> Array:
    """ν·ln s² + ν·(v/s² − 1) of a mean square v of ν degrees of freedom, at the variance s² of the white part that is likeliest.

    Measurements are in units of their white standard error, which the scatter of the samples shows: s² is no less than one. Left
    free, flicker replaced the white part: in 20 lots with B 30 µg its share came out ten thousand times too large, and the
    fit took part of it for a random walk that was not there.
    """
    likely = np.maximum(variance, 1.0)
    return dof * (np.log(likely) + variance / likely - 1.0)


class Restricted:
    """Restricted likelihood of blocks with coefficients of their own and none in common, on a whole grid of strengths at once.

    The covariance is W + t·K₂ + s·K₁. Columns that all blocks have in common (the poses are those of the table) are taken out
    once, by contrasts R with R·H = 0 and R·W·Rᵀ = 1, turned so that R·K₂·Rᵀ = Λ: the remaining block is smaller. For one
    share t the vectors of D·R·K₁·Rᵀ·D with D = (1 + t·Λ)^(−1/2) make all shares s diagonal: the whitened products of all
    columns are Σ xᵢ·xⱼ/(1 + s·λ), one matrix product for all shares and blocks. What elimination leaves of the bordered matrix
    (H z)ᵀV⁻¹(H z) is ln|HᵀV⁻¹H| and the whitened sum of squares.

    Parameters
    ----------
    h : (b, n, p), columns; z : (b, n), measurements in units of their white standard error
    white : (n, n), covariance of the white part; kernels : two covariances (n, n) of wander of variance one
    """

    def __init__(self, h: Array, z: Array, white: Array, kernels: tuple[Array, ...]) -> None:
        common, by_block = _common(h)
        root: Array = np.linalg.cholesky(white).astype(np.float64)
        turn, triangle = np.linalg.qr(_solved(root, common), mode="complete")
        contrasts = _solved(root, turn[:, common.shape[-1] :], transposed=True).T
        values, vectors = np.linalg.eigh(contrasts @ kernels[1] @ contrasts.T)
        self._second, contrasts = np.maximum(values, 0.0), vectors.T @ contrasts
        self._first = contrasts @ kernels[0] @ contrasts.T
        # ln|V| + ln|HᵀV⁻¹H| = ln|R·V·Rᵀ| + a constant, with the columns H that are taken out
        self._volume = 2.0 * (_log_sizes(root) + _log_sizes(triangle.astype(np.float64)))
        self.blocks, self.n, p = h.shape
        self.width = by_block.shape[-1] + 1
        self._dof = self.blocks * (self.n - p)
        # what a plain fit explains is taken off first: the likelihood is the same, and its rounding that of the residuals
        columns = np.concatenate([by_block, _left(h, z)[..., None]], axis=-1)
        self._columns = (contrasts @ np.moveaxis(columns, 0, 2).reshape(self.n, -1)).reshape(
            -1, self.width, self.blocks
        )
        self._i, self._j = np.tril_indices(self.width)
        self._bases: dict[float, tuple[Array, Array, float]] = {}

    def on_grid(self, first: Array, second: Array) -> Array:
        """Restricted deviance, (k, l), for shares (k,) of the first kernel and (l,) of the second."""
        bases = [self._basis(share) for share in second.tolist()]
        weights = [1.0 / (1.0 + np.outer(first, values)) for values, _, _ in bases]
        volumes = np.stack(
            [volume - np.log(weight).sum(axis=1) for (*_, volume), weight in zip(bases, weights, strict=True)]
        )
        squares, log_pivots = np.zeros((2, len(second), len(first)))
        for start in range(0, self.blocks, _PIECE):
            piece = np.ascontiguousarray(self._columns[..., start : start + _PIECE])
            rows = [self._products(piece, turn, weight) for (_, turn, _), weight in zip(bases, weights, strict=True)]
            pivots = self._pivots(rows)
            squares += pivots[-1].sum(axis=-1)
            log_pivots += np.log(pivots[:-1]).sum(axis=(0, -1))
        return (profiled_deviance(squares / self._dof, self._dof) + self.blocks * volumes + log_pivots).T

    def _basis(self, share: float) -> tuple[Array, Array, float]:
        """At a share of the second kernel λ (m,) of the first, the turn (m, m) to its vectors, and ln|W + t·K₂|.

        Stored, since the grids of one likelihood share some of their strengths.
        """
        if share not in self._bases:
            shrink = 1.0 / np.sqrt(1.0 + share * self._second)
            values, vectors = np.linalg.eigh(shrink[:, None] * self._first * shrink)
            volume = self._volume - 2.0 * float(np.log(shrink).sum())
            self._bases[share] = np.maximum(values, 0.0), (shrink[:, None] * vectors).T, volume
        return self._bases[share]

    def _products(self, piece: Array, turn: Array, weight: Array) -> Array:
        """Products (k, pairs, b) of the columns (m, p + 1, b) of some blocks, weighted for every share."""
        rotated = (turn @ piece.reshape(len(piece), -1)).reshape(piece.shape)
        pairs = np.empty((len(piece), len(self._i), piece.shape[-1]))
        # in the order of the lower triangle; picking pairs by index takes six times as long
        for column in range(self.width):
            first = column * (column + 1) // 2
            row_pairs = pairs[:, first : first + column + 1]
            np.multiply(rotated[:, column : column + 1], rotated[:, : column + 1], out=row_pairs)
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
    remaining = np.ones((h.shape[0], h.shape[2]), dtype=bool)
    common: list[Array] = []
    blocks = np.arange(len(h))
    for column in h[0].T:
        same = np.all(h == column[:, None], axis=1) & remaining
        if same.any(axis=1).all():
            remaining[blocks, same.argmax(axis=1)] = False
            common.append(column)
    others = np.swapaxes(np.swapaxes(h, 1, 2)[remaining].reshape(len(h), -1, h.shape[1]), 1, 2)
    return np.stack(common, axis=1) if common else np.zeros((h.shape[1], 0)), others


def _left(h: Array, z: Array) -> Array:
    """What plain least squares leaves of the measurements, (b, n)."""
    basis = np.linalg.qr(h)[0]
    return z - np.matmul(basis, np.matmul(np.swapaxes(basis, -1, -2), z[..., None]))[..., 0]


def _solved(root: Array, columns: Array, *, transposed: bool = False) -> Array:
    """Columns with the lower triangular ``root`` (n, n), or its transpose, divided off from the left."""
    return np.asarray(solve_triangular(root, columns, lower=True, trans=int(transposed)), dtype=np.float64)


def _log_sizes(triangle: Array) -> float:
    """ln|det| of a triangular matrix (n, n)."""
    return float(np.log(np.abs(np.diagonal(triangle))).sum())
