"""Whether a probability passes a limit, and logarithms of tail probabilities.

The tails are those of scipy.special: a thousand calls of scipy.stats take half a second.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from inertial.arrays import Array


def passes(probability: ArrayLike, above: float) -> bool | None:
    """Whether every probability is at least a limit; None where that cannot be told.

    What is no number neither passes nor fails: it decides nothing. One that is below the limit decides,
    whatever the others are. Without one, a probability that is no number (NaN) leaves the question open, and so do no
    probabilities at all.

    Parameters
    ----------
    probability : (...,), of so bad an agreement if the model is right
    above : limit, 0 … 1
    """
    values = np.asarray(probability, dtype=np.float64)
    if bool(np.any(values < above)):
        return False
    if values.size == 0 or not bool(np.all(values >= above)):
        return None
    return True


def log_f_tail(ratio: Array | float, first: float, second: float) -> Array:
    """Natural logarithm of the probability that F of so many degrees of freedom exceeds a ratio; the ratio's shape."""
    with np.errstate(divide="ignore"):
        return np.log(special.fdtrc(first, second, np.maximum(ratio, 0.0)))


def log_chi2_tail(value: Array | float, dof: float) -> Array:
    """Natural logarithm of the probability that chi-square exceeds a value; the value's shape."""
    with np.errstate(divide="ignore"):
        return np.log(special.chdtrc(dof, np.maximum(value, 0.0)))
