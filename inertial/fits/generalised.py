"""Generalised least squares of a lot's series under white noise and wander, with the strengths from the series themselves.

Blocks are the series of one unit and axis, each with coefficients of its own; further columns may have coefficients that all
blocks share. All series are in units of their white standard error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from inertial.fits.restricted import Restricted, profiled_deviance

Array = NDArray[np.float64]

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
    """The series of a lot.

    Parameters
    ----------
    h : (..., 3, n, p), columns with coefficients by block
    s : (..., 3, n, q), columns with coefficients of all blocks
    z : (..., 3, n), measurements
    profile : (n,), white standard deviation of each dwell, about one
    kernels : covariances (n, n) of the kinds of wander, of variance one
    """

    def __init__(self, h: Array, s: Array, z: Array, profile: Array, kernels: tuple[Array, ...]) -> None:
        scale = np.sqrt(np.mean(h**2, axis=-2, keepdims=True))
        self._scale = np.where(scale > 0.0, scale, 1.0)
        self._h, self._z, self.kernels = h / self._scale, z, kernels
        size = np.sqrt(np.mean(s**2, axis=tuple(range(s.ndim - 1))))
        self._size = np.where(size > 0.0, size, 1.0)
        self._s = s / self._size
        self.white = np.diag(profile**2)
        self.sound = np.ones(z.shape[:-1], dtype=bool)
        self._grids: dict[bytes, Callable[[Array, Array], Array]] = {}

    @property
    def dof(self) -> int:
        """Degrees of freedom of one block."""
        return self._z.shape[-1] - self._h.shape[-1]

    def covariance(self, shares: Sequence[float]) -> Array:
        """Covariance (n, n) of a series over the variance of its white part."""
        return self.white + sum(share * kernel for share, kernel in zip(shares, self.kernels, strict=True))

    def solve(self, shares: Sequence[float]) -> Solved:
        """Coefficients, their covariance and the restricted deviance at shares of the kernels."""
        root = np.asarray(np.linalg.cholesky(self.covariance(shares)), dtype=np.float64)
        whiten = solve_triangular(root, np.eye(len(root)), lower=True)
        h = np.matmul(whiten, self._h)
        gram = np.swapaxes(h, -1, -2) @ h
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
        size = self._scale[..., 0, :]
        return Solved(
            theta=theta / size,
            inverse=inverse / (size[..., :, None] * size[..., None, :]),
            gain=(gain @ whiten) / size[..., None],
            shared=shared / self._size,
            shared_inverse=shared_inverse / np.outer(self._size, self._size),
            squares=squares,
            variance=variance,
            deviance=deviance,
        )

    def _restricted(self, squares: Array, root: Array, gram: Array, shared_inverse: Array) -> tuple[float, float]:
        """Variance of the white part and restricted deviance of the sound blocks."""
        blocks = int(self.sound.sum())
        dof = blocks * self.dof - len(shared_inverse)
        variance = float(np.sum(squares[self.sound])) / dof
        logdet = np.broadcast_to(np.linalg.slogdet(gram)[1], squares.shape)[self.sound].sum()
        if len(shared_inverse):
            sizes = np.linalg.eigvalsh(shared_inverse)
            logdet -= np.sum(np.log(sizes[sizes > _SINGULAR * sizes[-1]]))
        deviance = float(profiled_deviance(variance, dof)) + 2.0 * blocks * np.sum(np.log(np.diagonal(root))) + logdet
        return variance, float(deviance)

    def deviances(self, first: Array, second: Array) -> Array:
        """Restricted deviance on a grid, (k, l), for shares (k,) of the first kernel and (l,) of the second."""
        return self._likelihood()(first, second)

    def _likelihood(self) -> Callable[[Array, Array], Array]:
        """What gives the restricted deviance of the sound blocks on a grid."""
        if self._s.shape[-1]:
            return self._pair_by_pair
        blocks = self.sound.tobytes()
        if blocks not in self._grids:
            h = np.broadcast_to(self._h, (*self._z.shape, self._h.shape[-1]))
            restricted = Restricted(h[self.sound], self._z[self.sound], self.white, self.kernels)
            self._grids = {blocks: restricted.on_grid}
        return self._grids[blocks]

    def _pair_by_pair(self, first: Array, second: Array) -> Array:
        grid = [self.solve(pair).deviance for pair in product(first.tolist(), second.tolist())]
        return np.reshape(grid, (len(first), len(second)))

    def best_shares(self) -> tuple[float, float]:
        """Shares of flicker and walk: their mean over the restricted likelihood; zero where the lot shows no wander.

        A slow drift within one record may be either, and the likelihood is flat between the two: its peak jumps from one
        answer to the other, its mean does not.
        """
        shares, deviances = np.array(SHARES), self._likelihood()
        coarse = deviances(shares, shares)
        if coarse[0, 0] - coarse.min() < _CHARGE:
            return 0.0, 0.0
        rows, columns = np.nonzero(coarse - coarse.min() < _FAR)
        flicker, walk = (_around(shares[places]) for places in (rows, columns))
        deviance = deviances(flicker**2, walk**2)
        rows, columns = np.nonzero(deviance - deviance.min() < _FAR)
        flicker, walk = _between(flicker[rows] ** 2), _between(walk[columns] ** 2)
        deviance = deviances(flicker**2, walk**2)
        # half of the belief beforehand is that a kind of wander is not there at all
        belief = np.outer(*(np.where(one > 0.0, 1.0, _FINE - 1.0) for one in (flicker, walk)))
        weight = belief * np.exp(-0.5 * (deviance - deviance.min()))
        weight = weight / weight.sum()
        return float(weight.sum(axis=1) @ flicker**2), float(weight.sum(axis=0) @ walk**2)


def _around(shares: Array) -> Array:
    """Standard deviations (_FINE,) to look at, one coarse step beyond those that are likely."""
    low, high = float(shares.min()) / _STEP, max(float(shares.max()), SHARES[1]) * _STEP
    return np.linspace(low**0.5, high**0.5, _FINE)


def _between(shares: Array) -> Array:
    """Standard deviations (_FINE,) from the least to the largest of the shares."""
    return np.linspace(float(shares.min()) ** 0.5, float(shares.max()) ** 0.5, _FINE)
