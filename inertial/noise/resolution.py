"""What the last digit of an output does to the figure of its white noise."""

import numpy as np

from inertial.arrays import Array
from inertial.distributions import normal_upper

FINE = 0.45
"""Noise of a sample over the step from which on rounding adds q²/12 and nothing else (W. F. Sheppard 1898; B. Widrow, IRE Trans.
Circuit Theory 3 (1956) 266): what depends on where the mean lies between two digits is then below a tenth of the
variance."""

_SAME = 1e-6
"""Differences of values that are this close, over the step, come from rounding of the numbers and not from the output."""


def step_of(values: Array) -> float:
    """Smallest step (unit of the output) between the different values (k,) that an output took; zero for a constant one."""
    steps = np.diff(np.unique(values))
    return float(np.min(steps[steps > _SAME * np.max(steps)])) if steps.size else 0.0


def without_rounding(variance: Array, step: Array) -> Array:
    """Variance of a sample before it was rounded to `step`: Sheppard's correction, less q²/12; the output's unit squared."""
    return np.maximum(variance - step**2 / 12.0, 0.0)


def ripple(spread: Array, step: Array) -> Array:
    """Largest part of the variance after rounding that Sheppard's correction leaves, by where the mean lies between two digits.

    The first harmonic of the variance over the position of the mean between two digits, for normal noise of the standard
    deviation σ before rounding, has the amplitude (4σ² + q²/π²)·exp(−2π²σ²/q²) (Widrow 1956).

    Parameters
    ----------
    spread, step : standard deviation before rounding and step, unit of the output
    """
    return (4.0 * spread**2 + step**2 / np.pi**2) * np.exp(-2.0 * (np.pi * spread / step) ** 2)


def most(step: float, outside: float, count: int) -> float:
    """Largest standard deviation of a sample (95 %, one-sided) of an output that seldom left its commonest digit.

    The noise is largest where the mean lies in the middle of the digit: then the share outside is 2·(1 − Φ(q/2σ)). A wander
    of the mean adds to the share, so the limit holds with it. Infinite for a share of a half or more.

    Parameters
    ----------
    step : unit of the output
    outside : share of the samples beside the commonest digit
    count : samples
    """
    bound = outside + 1.645 * float(np.sqrt(outside * (1.0 - outside) / count)) + 3.0 / count
    return step / (2.0 * float(normal_upper(0.5 * bound))) if bound < 1.0 else np.inf
