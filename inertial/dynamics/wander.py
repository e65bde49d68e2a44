"""White noise, 1/f noise and random walk in a short series of adjacent means, and how well each is known.

The variance of wander beside known noise and fitted terms; covariances of means, and degrees of freedom of their variances.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import null_space, toeplitz
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import norm, t

from inertial.arrays import Array

FEWEST_DOF = 1.0
GRID = 120  # variances of wander of a posterior
WALK_SHARES = np.array([0.0, 0.15, 0.4, 0.65, 0.85, 0.95, 0.985, 1.0])  # of the random walk in it
REACHED, FARTHEST = 0.99, 30.0  # bracket of a 95 % interval: the deviation at this probability, times this
ALLAN_PARTS, MOST_PARTS = 10, 720  # of a mean, beginnings of overlapping means; of all means
CONSTANT_DOF = 1.0  # of a constant output


@dataclass(frozen=True)
class Wander:
    """Variance of wander and the standard deviation of its estimate, squares of the output's unit."""

    variance: float
    error: float


def wander(rows: Array, output: Array, known: Array, kernel: Array) -> Wander:
    """Variance of wander with the correlation ``kernel`` (n, n) beside a known covariance, by restricted likelihood.

    The standard deviation of the estimate is that of the expected information, ½·tr((P·K)²) for the variance.

    Parameters
    ----------
    rows : (n, terms); output : (n,), any unit
    known : (n, n), square of the output's unit
    """
    left = output - rows @ np.linalg.lstsq(rows, output, rcond=None)[0]
    size = float(left @ left) / max(1, len(left) - rows.shape[1])
    if size <= 0.0:
        return Wander(0.0, 0.0)

    def cost(log: float) -> float:
        covariance = known + np.exp(log) * kernel
        root = np.linalg.cholesky(covariance)
        x, y = np.linalg.solve(root, rows), np.linalg.solve(root, output)
        normal = x.T @ x
        rest = y - x @ np.linalg.solve(normal, x.T @ y)
        return float(2.0 * np.sum(np.log(np.diag(root))) + np.linalg.slogdet(normal)[1] + rest @ rest)

    minimum: Any = minimize_scalar(cost, bounds=(np.log(1e-6 * size), np.log(1e3 * size)), method="bounded")
    variance = float(np.exp(minimum.x))
    inverse = np.linalg.inv(known + variance * kernel)
    free = inverse - inverse @ rows @ np.linalg.solve(rows.T @ inverse @ rows, rows.T @ inverse)
    product = free @ kernel
    return Wander(variance, float(np.sqrt(2.0 / np.sum(product * product.T))))


def logarithmic_kernel(count: int) -> Array:
    """Covariance (count,) of 1/f noise in adjacent means over their lag in means, for a one-sided density 1/f; up to a constant.

    It is minus the mean of ln|t − t′| over both means: 3/2 at lag 0, and −ln k from afar. A constant is common to all means,
    which cancels in any difference; see :func:`variance_of_sum`.
    """
    k = np.arange(1, count, dtype=np.float64)
    inner = np.where(k > 1.0, (k - 1.0) ** 2 * np.log(np.maximum(k - 1.0, 1.0)), 0.0)
    far = 0.5 * ((k + 1.0) ** 2 * np.log(k + 1.0) + inner - 2.0 * k**2 * np.log(k)) - 1.5
    return np.concatenate([[1.5], -far])


def variance_of_sum(weights: Array) -> float:
    """Variance of Σ wₖ·mean k in 1/f noise with the one-sided density 1/f, for adjacent means and weights (n,) of sum zero."""
    size = len(weights)
    spectrum = np.abs(np.fft.rfft(weights, 2 * size)) ** 2
    products = np.fft.irfft(spectrum, 2 * size)[:size]
    kernel = logarithmic_kernel(size)
    return float(products[0] * kernel[0] + 2.0 * products[1:] @ kernel[1:])


def stated_error(variance: float, slope: float, error: float, scatter: float = 0.0) -> float:
    """Standard uncertainty u, half of whose U (k = 2) has 95 % where a part of the variance is an estimate from few data.

    Welch and Satterthwaite: ν = 2·V²/Var V, and u = √V·t₀.₉₇₅(ν)/z₀.₉₇₅ (GUM, G.4).

    Parameters
    ----------
    variance : V; slope : of V over the estimated variance; error : standard deviation of that estimate
    scatter : relative standard deviation of a factor of √V that is estimated from the same record
    """
    if variance <= 0.0:
        return 0.0
    spread = (slope * error / variance) ** 2 + (2.0 * scatter) ** 2
    dof = max(FEWEST_DOF, 2.0 / spread) if spread > 0.0 else np.inf
    return float(np.sqrt(variance) * t.ppf(0.975, dof) / norm.ppf(0.975))


@dataclass(frozen=True)
class Posterior:
    """Mixtures of 1/f noise and random walk with their probabilities.

    flicker, walk : (g,), factors of the two kernels, squares of the output's unit; probability : (g,)
    """

    flicker: Array
    walk: Array
    probability: Array

    def error_of(self, known: float, of_flicker: float, of_walk: float) -> float:
        """Standard uncertainty u, half of whose U (k = 2) has 95 %, of an estimate of the variance known + the shares of both.

        The estimate is normal for each mixture; the 95 % are those of all of them.
        """
        each = np.sort(np.sqrt(known + of_flicker * self.flicker + of_walk * self.walk))
        order = np.argsort(known + of_flicker * self.flicker + of_walk * self.walk)
        probability = self.probability[order]
        top = float(each[np.cumsum(probability) <= REACHED].max(initial=each[0]))
        if top <= 0.0:
            return 0.0

        def outside(half: float) -> float:
            return float(2.0 * probability @ norm.cdf(-half / np.maximum(each, 1e-300)) - 0.05)

        half_width: Any = brentq(outside, 0.0, FARTHEST * top)
        return float(half_width / norm.ppf(0.975))


@dataclass(frozen=True)
class KnownStrength:
    """Root of the factor of a kernel by another record of the device: value, nan where it is only limited, and 95 % ends."""

    value: float
    low: float
    high: float

    def log_likelihood(self, strength: Array) -> Array:
        """Of strengths (g,), of the estimate: its logarithm is normal; a limit stands for an estimate of zero."""
        if np.isfinite(self.value) and self.low > 0.0:
            width = np.log(self.high / self.low) / (2.0 * float(norm.ppf(0.975)))
            apart = np.log(np.maximum(strength, 1e-6 * self.low) / self.value) / width
            return np.asarray(-0.5 * apart**2, dtype=np.float64)
        if np.isfinite(self.high) and self.high > 0.0:
            return np.asarray(-0.5 * (strength * float(norm.ppf(0.975)) / self.high) ** 2, dtype=np.float64)
        return np.zeros_like(strength)


@dataclass(frozen=True)
class Remainders:
    """What is left of outputs beside fitted terms, and the two kinds of wander in it.

    free : (n, n − terms); sizes : mean variance (2,) of 1/f noise and walk of unit factor
    shares : variances (n − terms,) along principal axes, and these axes, for each of :data:`WALK_SHARES`
    """

    free: Array
    sizes: tuple[float, float]
    shares: list[tuple[Array, Array]]

    @classmethod
    def of(cls, rows: Array, flicker: Array, walk: Array) -> "Remainders":
        """Of terms (n, terms), and kernels (n, n)."""
        free = null_space(rows.T)
        kernels = [free.T @ kernel @ free for kernel in (flicker, walk)]
        flicker_size, walk_size = (float(np.trace(kernel)) / free.shape[1] for kernel in kernels)
        mixed = ((1.0 - share) / flicker_size * kernels[0] + share / walk_size * kernels[1] for share in WALK_SHARES)
        return cls(free, (flicker_size, walk_size), [(values, axes) for values, axes in map(np.linalg.eigh, mixed)])


def wander_posterior(
    remainders: Remainders, output: Array, white: float, known: Sequence[KnownStrength] = ()
) -> Posterior:
    """Probabilities of the variances of 1/f noise and random walk beside white noise, by restricted likelihood.

    A short record knows each variance to a third at best: what one value of it says of an interval is too little where it is
    estimated low. Student's t is the case without white noise. The prior of the variance is that of Jeffreys, that of the walk's
    share in it (of the variance about the fitted terms) is even.

    Parameters
    ----------
    output : (n,), any unit
    white : known variance of each value, square of the output's unit
    known : strengths of 1/f noise and walk by another record
    """
    contrasts, sizes = remainders.free.T @ output, remainders.sizes
    if not float(contrasts @ contrasts) > 0.0:
        return Posterior(np.zeros(1), np.zeros(1), np.ones(1))
    variance = np.geomspace(1e-5, 1e4, GRID) * float(np.mean(contrasts**2))
    logs = np.empty((WALK_SHARES.size, GRID))
    for k, (part, turn) in enumerate(remainders.shares):
        total = white + variance[:, None] * part
        prior = np.log(variance) + 0.5 * np.log(np.sum((part / total) ** 2, axis=1))  # over ln of the variance
        logs[k] = prior - 0.5 * np.sum(np.log(total) + (turn.T @ contrasts) ** 2 / total, axis=1)
    shares = WALK_SHARES[:, None] * variance
    sides = ((variance - shares) / sizes[0]).ravel(), (shares / sizes[1]).ravel()
    log = logs.ravel() + sum(term.log_likelihood(np.sqrt(side)) for term, side in zip(known, sides, strict=False))
    weight = np.exp(log - log.max())
    return Posterior(*sides, np.asarray(weight / weight.sum(), dtype=np.float64))


@dataclass(frozen=True)
class IdentifiedNoise:
    """Bias instability B and random walk K of a device, by a longer record: value, nan where only limited, and 95 % interval.

    bias_instability : unit of the output; walk : unit of the output per √s
    """

    bias_instability: tuple[float, float, float]
    walk: tuple[float, float, float]

    def strengths(self, mean_s: float) -> tuple[KnownStrength, KnownStrength]:
        """Roots of the factors of the kernels of :func:`kernels_of`, means over some s; 1/f noise has the density B²/(π·f)."""
        flicker, walk = np.array(self.bias_instability) / np.sqrt(np.pi), np.array(self.walk) * np.sqrt(mean_s)
        return KnownStrength(*flicker.tolist()), KnownStrength(*walk.tolist())


def kernels_of(n: int) -> tuple[Array, Array]:
    """Covariances (n, n) of 1/f noise and of a random walk in adjacent means, the walk of variance 1 over each.

    1/f noise goes on below one period of the record, and is a slope there: the kernel is that of the logarithm.
    """
    at = np.arange(n, dtype=np.float64)
    walk = np.minimum.outer(at, at) + np.where(np.equal.outer(at, at), 1.0 / 3.0, 0.5)
    return toeplitz(logarithmic_kernel(n) + np.log(n) + 1.0), walk


def line_of(count: int) -> Array:
    """Weights (count, 2) of means in the level and the slope, per mean, of the straight line through them."""
    at = np.arange(count, dtype=np.float64)
    return np.asarray(np.linalg.pinv(np.column_stack([np.ones(count), at - at.mean()])).T, dtype=np.float64)


@lru_cache(maxsize=32)
def remainders_of(count: int, terms: int) -> Remainders:
    """What is left of ``count`` means beside a level (1 term), or a line (2 terms)."""
    return Remainders.of(line_of(count)[:, :terms], *kernels_of(count))


def dof_of_sd(mixtures: Posterior, white: float, count: int) -> float:
    """Effective degrees of freedom of the variance of ``count`` correlated means, each with white noise of a variance."""
    return _dof(mixtures, white, *_moments_of_sd(count))


def dof_of_allan(mixtures: Posterior, white: float, count: int) -> float:
    """Effective degrees of freedom of the overlapping Allan variance of ``count`` means, as if these began every tenth of one."""
    return _dof(mixtures, white, *_moments_of_allan(count))


@lru_cache(maxsize=32)
def _moments_of_sd(count: int) -> tuple[Array, Array]:
    centring = np.eye(count) - 1.0 / count
    return _moments([centring @ kernel for kernel in (np.eye(count), *kernels_of(count))])


@lru_cache(maxsize=32)
def _moments_of_allan(count: int) -> tuple[Array, Array]:
    parts = min(ALLAN_PARTS, max(1, MOST_PARTS // count))
    flicker, walk = kernels_of(parts * count)

    def differences(rows: Array) -> Array:
        """Later mean minus earlier one, of rows (parts·count, m)."""
        sums = np.concatenate([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)])
        return (sums[2 * parts :] - 2.0 * sums[parts:-parts] + sums[: -2 * parts]) / parts

    each = (float(parts) * np.eye(parts * count), flicker, walk / parts)
    return _moments([differences(differences(rows).T) for rows in each])


def _moments(parts: list[Array]) -> tuple[Array, Array]:
    """Traces (3,) and traces of products (3, 3) of CV for white noise, 1/f noise and walk of unit strength."""
    traces = np.array([np.trace(part) for part in parts])
    return traces, np.array([[np.sum(part * other.T) for other in parts] for part in parts])


def _dof(mixtures: Posterior, white: float, traces: Array, products: Array) -> float:
    """(tr CV)²/tr((CV)²) of a sum of squares with the covariance V of the mixtures.

    The relative variance 2/ν is averaged over them: few means do not tell a walk from 1/f noise.
    """
    sizes = np.stack([np.full(mixtures.flicker.size, white), mixtures.flicker, mixtures.walk])
    squares, means = np.einsum("ig,ij,jg->g", sizes, products, sizes), traces @ sizes
    if not np.all(means > 0.0):
        return CONSTANT_DOF
    return float(1.0 / (mixtures.probability @ (squares / means**2)))
