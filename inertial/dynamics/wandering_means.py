"""Adjacent means of white noise, 1/f noise and random walk: covariances, and degrees of freedom of their variances."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import toeplitz

from inertial.arrays import Array
from inertial.dynamics.wander import KnownStrength, Posterior, Remainders, logarithmic_kernel

ALLAN_PARTS, MOST_PARTS = 10, 720  # of a mean, beginnings of overlapping means; of all means
CONSTANT_DOF = 1.0  # of a constant output


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
    return _moments([differences(differences(one).T) for one in each])


def _moments(parts: list[Array]) -> tuple[Array, Array]:
    """Traces (3,) and traces of products (3, 3) of CV for white noise, 1/f noise and walk of unit strength."""
    traces = np.array([np.trace(part) for part in parts])
    return traces, np.array([[np.sum(one * other.T) for other in parts] for one in parts])


def _dof(mixtures: Posterior, white: float, traces: Array, products: Array) -> float:
    """(tr CV)²/tr((CV)²) of a sum of squares with the covariance V of the mixtures.

    The relative variance 2/ν is averaged over them: few means do not tell a walk from 1/f noise.
    """
    sizes = np.stack([np.full(mixtures.flicker.size, white), mixtures.flicker, mixtures.walk])
    squares, means = np.einsum("ig,ij,jg->g", sizes, products, sizes), traces @ sizes
    if not np.all(means > 0.0):
        return CONSTANT_DOF
    return float(1.0 / (mixtures.probability @ (squares / means**2)))
