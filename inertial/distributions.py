"""Quantiles and tail areas of a few distributions by scipy.special, with the numbers of scipy.stats.

Loading scipy.stats takes 0.7 s of processor time, which a command that needs one quantile should not spend.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

Array = NDArray[np.float64]


def chi2_quantile(probability: ArrayLike, dof: ArrayLike) -> Array:
    """Value below which chi-square with ``dof`` degrees of freedom lies with a probability; broadcast."""
    return np.asarray(2.0 * special.gammaincinv(0.5 * _positive(dof), probability), dtype=np.float64)


def chi2_tail(value: ArrayLike, dof: ArrayLike) -> Array:
    """Probability that chi-square with ``dof`` degrees of freedom exceeds a value, one below zero; broadcast."""
    return np.asarray(special.chdtrc(_positive(dof), np.maximum(value, 0.0)), dtype=np.float64)


def chi2_upper(probability: ArrayLike, dof: ArrayLike) -> Array:
    """Value that chi-square with ``dof`` degrees of freedom exceeds with a probability; broadcast."""
    return np.asarray(special.chdtri(_positive(dof), probability), dtype=np.float64)


def normal_upper(probability: ArrayLike) -> Array:
    """Value that a standard normal variable exceeds with a probability."""
    return np.asarray(-special.ndtri(probability), dtype=np.float64)


def _positive(dof: ArrayLike) -> Array:
    """Degrees of freedom; NaN where there are none: scipy.special answers 0 there, which would pass for a probability."""
    values = np.asarray(dof, dtype=np.float64)
    return np.where(values > 0.0, values, np.nan)
