"""Non-negative mixtures of noise terms under an Allan variance curve, in units of one sample."""

from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls
from scipy.special import digamma, polygamma

from inertial.arrays import Array, Flags, Index
from inertial.noise.covariance import Sums, sums

TERMS = ("Q", "N", "B", "K", "R")
_ROUNDS = 4  # of weights from the strengths before
_TURNS = 3  # of a covariance and the solution under it
_STEPS = 12  # of Gauss-Newton, and halvings of one
_SETTLED = 1e-6  # chi-square that a step no longer takes off
_FEWEST_DOF = 1.0
_FLOOR = 1e-6  # of the eigenvalues of a covariance, over the largest


def basis(m: Index) -> Array:
    """Allan variances (t, 5) of unit Q, N, B, K, R at averaging times of `m` samples, tau = m.

    3/tau^2, 1/tau, 2 ln2/pi, tau/3, tau^2/2: IEEE Std 952-1997, annex C.
    """
    return _basis(m.astype(np.float64).tobytes())


@lru_cache(maxsize=64)
def _basis(times: bytes) -> Array:
    """The array of :func:`basis`, read-only, for the bytes of the averaging times (t,)."""
    tau = np.frombuffer(times)
    columns = np.stack(
        [3.0 / tau**2, 1.0 / tau, np.full_like(tau, 2.0 * np.log(2.0) / np.pi), tau / 3.0, tau**2 / 2.0], 1
    )
    columns.setflags(write=False)
    return columns


def degrees_of_freedom(variance: Array, m: Index, n: int, records: int = 1) -> Array:
    """Equivalent degrees of freedom 2 v^2 / Var[v], (..., t), under the mixture that fits each curve (..., t).

    Parameters
    ----------
    records : records of ``n`` samples of which each variance is the mean
    """
    moments = sums(n, tuple(m.tolist())).averaged(records)
    flat = variance.reshape(-1, m.size)
    edf = np.stack([_one_edf(row, moments) for row in flat]) if flat.size else flat
    return edf.reshape(variance.shape)


def _one_edf(variance: Array, moments: Sums) -> Array:
    if not np.all(variance > 0.0):  # a dead channel: nothing differs and nothing is estimated
        return np.ones_like(variance)
    strengths = first_guess(variance, moments)
    expected = basis(moments.m) @ strengths
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
class MixtureFit:
    """Generalised least squares on the log-variance of one channel, the covariance taken at given strengths."""

    model: Array
    """(t, 5)"""
    target: Array
    """(t,) log-variance less the mean of the logarithm of chi-square."""
    whiten: Array
    """(t, t) inverse of the lower Cholesky factor of the covariance of the log-variances."""

    def cost(self, strengths: Array) -> float:
        """Chi-square of the curve."""
        expected = self.model @ strengths
        if not expected.min() > 0.0:
            return np.inf
        residual = self.whiten @ (self.target - np.log(expected))
        return float(residual @ residual)

    @property
    def volume(self) -> float:
        """Logarithm of the determinant of the covariance of the log-variances."""
        return -2.0 * float(np.log(np.diagonal(self.whiten)).sum())

    def solve(self, free: Flags, start: Array) -> tuple[Array, float]:
        """Best strengths and their chi-square: those not `free` stay at `start`, none falls below zero."""
        strengths = start.copy()
        cost = self.cost(strengths)
        for _ in range(_STEPS if free.any() else 0):
            trial = self._gauss_newton(free, strengths)
            better = self.cost(trial)
            halvings = 0
            while not better <= cost and halvings < _STEPS:
                trial = 0.5 * (trial + strengths)
                better, halvings = self.cost(trial), halvings + 1
            if not better <= cost:
                break
            settled = cost - better < _SETTLED
            strengths, cost = trial, better
            if settled:
                break
        return strengths, cost

    def _gauss_newton(self, free: Flags, strengths: Array) -> Array:
        expected = self.model @ strengths
        if not expected.min() > 0.0:
            expected = np.where(expected > 0.0, expected, np.exp(self.target))
        rows = self.whiten @ (self.model / expected[:, None])
        right_side = self.whiten @ (self.target - np.log(expected) + 1.0)
        held = strengths[~free]
        if held.any():
            right_side = right_side - rows[:, ~free] @ held
        columns = rows[:, free]
        size = np.sqrt(np.sum(columns * columns, axis=0))
        trial = strengths.copy()
        trial[free] = nnls(columns / size, right_side)[0] / size
        return trial


def problem(variance: Array, moments: Sums, strengths: Array) -> MixtureFit:
    """The least-squares problem of one curve (t,), its covariance taken under `strengths` (5,).

    The logarithm of chi-square with nu degrees of freedom has mean digamma(nu/2) - ln(nu/2) and variance trigamma(nu/2);
    the correlations are those of the variances.
    """
    expected = basis(moments.m) @ strengths
    covariance = moments.covariance(strengths[:4], strengths[4]) / np.outer(expected, expected)
    half = 1.0 / np.diagonal(covariance)  # nu / 2
    spread = np.sqrt(polygamma(1, half))
    correlation = covariance * np.sqrt(np.outer(half, half))
    return MixtureFit(
        model=basis(moments.m),
        target=np.log(variance) - (digamma(half) - np.log(half)),
        whiten=_whitener(correlation * np.outer(spread, spread)),
    )


def settled(variance: Array, moments: Sums, free: Flags, start: Array) -> tuple[MixtureFit, Array, float]:
    """The problem whose covariance is that of its own solution, the solution and its chi-square."""
    strengths = start
    for _ in range(_TURNS):
        strengths, _ = problem(variance, moments, strengths).solve(free, strengths)
    task = problem(variance, moments, strengths)
    return task, *task.solve(free, strengths)


def deviance(variance: Array, moments: Sums, free: Flags, start: Array) -> tuple[float, Array]:
    """Twice the negative log-likelihood of a curve (t,) with the terms that are `free`, and their strengths (5,).

    The covariance is that of the strengths at which it is taken: a ramp, which scatters nothing, then has to agree with the last
    points of a curve exactly, and a walk only as well as so few independent differences allow. With one covariance for both the
    one that it was taken under always wins. The best of all rounds counts: the strengths solve for a covariance that is given.
    """
    best, likeliest, strengths = np.inf, start, start
    for _ in range(_TURNS + 1):
        task = problem(variance, moments, strengths)
        now = task.cost(strengths) + task.volume
        if now < best:
            best, likeliest = now, strengths
        strengths, _ = task.solve(free, strengths)
    return best, likeliest


def _whitener(covariance: Array) -> Array:
    """Inverse of the lower Cholesky factor; rounding may cost a nearly singular covariance its definiteness by a hair."""
    identity = np.eye(len(covariance))
    with suppress(np.linalg.LinAlgError):
        whiten = solve_triangular(np.linalg.cholesky(covariance), identity, lower=True)
        # the smallest eigenvalue is at least this, and the largest at most the trace
        if 1.0 / float(np.sum(whiten * whiten)) > _FLOOR * float(np.trace(covariance)):
            return whiten
    values, vectors = np.linalg.eigh(covariance)
    floor = _FLOOR * float(values[-1])
    if values[0] <= floor:
        covariance = (vectors * np.maximum(values, floor)) @ vectors.T
    return solve_triangular(np.linalg.cholesky(covariance), identity, lower=True)
