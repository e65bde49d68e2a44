"""Noise of the norm of gravity between dwells: wander of an axis shows in it as far as the force points along that axis.

The residual |f| − g of a dwell is fᵀ/|f| times the three axes' errors. Axes that wander alike and independently therefore give
cov(ρ) = s²·(diag(e²) + (F·K_F + W·K_W) ∘ (u·uᵀ)) with the directions u of the force, flicker K_F and random walk K_W. Both
shares and s² are estimated with the coefficients' columns projected out (restricted likelihood).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from inertial.noise.flicker import flicker_kernel
from inertial.noise.measurands import walk_kernel

Array = NDArray[np.float64]

_SHARES = np.concatenate([[0.0], 10.0 ** np.arange(-1.0, 5.0)])
WALK_ABOUT_MEAN = 1.0 / 6.0
"""Mean variance about the record's mean of a walk that gathers a variance of one over it."""

_FINER = (10.0**0.5, 10.0**0.25)


@dataclass(frozen=True)
class NormNoise:
    """Noise of the norms of n dwells.

    whiten : (n, n), inverse root of the covariance over s²; flicker, walk : shares, over the mean of e²
    """

    whiten: Array
    flicker: float
    walk: float


def norm_noise(residual: Array, rows: Array, direction: Array, time: Array, error: Array) -> NormNoise:
    """Noise of the residuals (n,) of a norm fit.

    Parameters
    ----------
    rows : (n, p), derivatives by the coefficients; direction : (n, 3), unit vectors of the force
    time : (n,), s; error : (n,), white standard errors, any common unit
    """
    white = error / np.sqrt(np.mean(error**2))
    along = direction @ direction.T
    kernels = flicker_kernel(time) * along, walk_kernel(time) * along

    def root(flicker: float, walk: float) -> Array:
        return np.asarray(np.linalg.cholesky(np.diag(white**2) + flicker * kernels[0] + walk * kernels[1]), np.float64)

    def deviance(shares: tuple[float, float]) -> float:
        low = root(*shares)
        h, z = (np.asarray(solve_triangular(low, part, lower=True)) for part in (rows, residual))
        q, triangle = np.linalg.qr(h)
        left = z - q @ (q.T @ z)
        volume = np.log(np.diagonal(low)).sum() + np.log(np.abs(np.diagonal(triangle))).sum()
        return float((residual.size - rows.shape[1]) * np.log(left @ left) + 2.0 * volume)

    best = min(((deviance((f, w)), (f, w)) for f in _SHARES.tolist() for w in _SHARES.tolist()), key=lambda one: one[0])
    for step in _FINER:
        f, w = best[1]
        near = [(f * a, w * b) for a in (1.0 / step, 1.0, step) for b in (1.0 / step, 1.0, step)]
        best = min([best, *((deviance(one), one) for one in dict.fromkeys(near))], key=lambda one: one[0])
    low = root(*best[1])
    return NormNoise(np.asarray(solve_triangular(low, np.eye(time.size), lower=True)), *best[1])
