"""Logarithms of tail probabilities by scipy.special; a thousand calls of scipy.stats take half a second."""

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


def log_f_tail(ratio: Array | float, first: float, second: float) -> Array:
    """Natural logarithm of the probability that F of so many degrees of freedom exceeds a ratio; the ratio's shape."""
    with np.errstate(divide="ignore"):
        return np.log(special.fdtrc(first, second, np.maximum(ratio, 0.0)))


def log_chi2_tail(value: Array | float, dof: float) -> Array:
    """Natural logarithm of the probability that chi-square exceeds a value; the value's shape."""
    with np.errstate(divide="ignore"):
        return np.log(special.chdtrc(dof, np.maximum(value, 0.0)))
