"""Non-negative mixtures of noise terms under an Allan variance curve, in units of one sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from inertial.noise.covariance import Sums, sums

Array = NDArray[np.float64]

TERMS = ("Q", "N", "B", "K", "R")
_ROUNDS = 4
_FEWEST_DOF = 1.0


def basis(m: NDArray[np.int64]) -> Array:
    """Allan variances (t, 5) of unit Q, N, B, K, R at averaging times of `m` samples, tau = m.

    3/tau^2, 1/tau, 2 ln2/pi, tau/3, tau^2/2: IEEE Std 952-1997, annex C.
    """
    tau = m.astype(np.float64)
    return np.stack(
        [
            3.0 / tau**2,
            1.0 / tau,
            np.full_like(tau, 2.0 * np.log(2.0) / np.pi),
            tau / 3.0,
            tau**2 / 2.0,
        ],
        1,
    )


def degrees_of_freedom(variance: Array, m: NDArray[np.int64], n: int) -> Array:
    """Equivalent degrees of freedom 2 v^2 / Var[v], (..., t), under the mixture that fits each curve (..., t)."""
    moments = sums(n, tuple(m.tolist()))
    flat = variance.reshape(-1, m.size)
    edf = np.stack([_one_edf(row, moments) for row in flat]) if flat.size else flat
    return edf.reshape(variance.shape)


def _one_edf(variance: Array, moments: Sums) -> Array:
    model = basis(moments.m)
    strengths = first_guess(variance, moments)
    expected = model @ strengths
    if not np.all(expected > 0.0):  # a dead channel: every difference is zero and nothing is estimated
        return np.ones_like(variance)
    spread = np.diagonal(moments.covariance(strengths[:4], strengths[4]))
    return np.maximum(2.0 * expected**2 / np.where(spread > 0.0, spread, np.inf), _FEWEST_DOF)


def first_guess(variance: Array, moments: Sums) -> Array:
    """Strengths (5,) by non-negative least squares on relative deviations, weighted as for white noise."""
    model = basis(moments.m)
    weight = 1.0 / np.sqrt(moments.m.astype(np.float64))
    expected = np.maximum(variance, np.finfo(float).tiny)
    strengths = np.zeros(len(TERMS))
    for _ in range(_ROUNDS):
        rows = model * (weight / expected)[:, None]
        size = np.linalg.norm(rows, axis=0)
        strengths = nnls(rows / size, variance * weight / expected)[0] / size
        expected = model @ strengths
        if not np.all(expected > 0.0):
            break
    return strengths


@dataclass(frozen=True)
class Problem:
    """Generalised least squares on the variances of one curve, their covariance taken under some mixture.

    The residuals are ratios to that mixture, not logarithms: at few degrees of freedom neighbouring estimates agree far
    better than a logarithm's curvature allows (chi-square 80 of the truth itself, for 15 points of a random walk), while
    the ratios have exactly this covariance. The mixture, not the data, sets the weights, so low points gain none.
    """

    rows: Array
    """(t, 5) whitened variances of unit strengths."""
    wanted: Array
    """(t,) whitened measured variances."""

    def cost(self, strengths: Array) -> float:
        """Chi-square of the curve."""
        residual = self.wanted - self.rows @ strengths
        return float(residual @ residual)

    def solve(self, free: NDArray[np.bool_], held: Array) -> tuple[Array, float]:
        """Best strengths and their chi-square: those not `free` stay as `held`, none falls below zero."""
        strengths = held.copy()
        if free.any():
            size = np.linalg.norm(self.rows[:, free], axis=0)
            rest = self.wanted - self.rows[:, ~free] @ held[~free]
            strengths[free] = nnls(self.rows[:, free] / size, rest)[0] / size
        return strengths, self.cost(strengths)


def problem(variance: Array, moments: Sums, strengths: Array) -> Problem:
    """The least-squares problem of one curve (t,), its covariance taken under `strengths` (5,)."""
    model = basis(moments.m)
    expected = model @ strengths
    covariance = moments.covariance(strengths[:4], strengths[4]) / np.outer(expected, expected)
    root = _root(covariance)
    return Problem(
        rows=solve_triangular(root, model / expected[:, None], lower=True),
        wanted=solve_triangular(root, variance / expected, lower=True),
    )


def _root(covariance: Array) -> Array:
    """Cholesky factor; the covariances set to zero far off the diagonal may cost it its definiteness by a hair."""
    values, vectors = np.linalg.eigh(covariance)
    floor = 1e-6 * float(values[-1])
    if values[0] > floor:
        return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    return np.asarray(np.linalg.cholesky((vectors * np.maximum(values, floor)) @ vectors.T), dtype=np.float64)
