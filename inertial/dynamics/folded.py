"""Magnitude of a quantity that noise may make up: the mean of |N(μ, σ²)| inverted."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

Array = NDArray[np.float64]
FARTHEST = 8.0  # standard uncertainties beyond which noise adds nothing to a magnitude
GRID = 801


def mean_magnitude(mean: Array) -> Array:
    """Mean of |x| for x from a normal distribution of standard deviation 1 about ``mean`` (n,)."""
    size = np.abs(mean)
    return np.asarray(size * (1.0 - 2.0 * norm.cdf(-size)) + 2.0 * norm.pdf(size))


def magnitude(value: float, error: float) -> float:
    """The size μ for which the mean of |N(μ, σ²)| is the one found; 0 where noise alone makes as much on average.

    A largest departure, a sum of magnitudes, is otherwise that of the noise where nothing is there: 0.8 σ on average.

    Parameters
    ----------
    value : as estimated, of either sign; error : its standard uncertainty; both of one unit
    """
    if error <= 0.0 or abs(value) >= FARTHEST * error:
        return abs(value)
    sizes, means = _table()
    return float(error * np.interp(abs(value) / error, means, sizes, left=0.0))


@cache
def _table() -> tuple[Array, Array]:
    sizes = np.linspace(0.0, FARTHEST, GRID)
    return sizes, mean_magnitude(sizes)
