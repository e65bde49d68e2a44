"""What an exciter can do at a frequency."""

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import Array

STANDARD_GRAVITY = 9.80665


def largest_level(frequency: ArrayLike, *, displacement_m: float, velocity_m_s: float, acceleration_g: float) -> Array:
    """Largest peak acceleration in g at frequencies in Hz: the least of ω²·displacement, ω·velocity and the limit."""
    w = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)
    return np.minimum(np.minimum(w**2 * displacement_m, w * velocity_m_s) / STANDARD_GRAVITY, acceleration_g)
