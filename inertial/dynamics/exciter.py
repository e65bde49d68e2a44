"""What an exciter can do at a frequency, and the uncertainty budget of a comparison on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
STANDARD_GRAVITY = 9.80665


def largest_level(frequency: ArrayLike, *, displacement_m: float, velocity_m_s: float, acceleration_g: float) -> Array:
    """Largest peak acceleration in g at frequencies in Hz: the least of ω²·displacement, ω·velocity and the limit."""
    w = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)
    return np.minimum(np.minimum(w**2 * displacement_m, w * velocity_m_s) / STANDARD_GRAVITY, acceleration_g)


def stroke(frequency: float, level_g: float) -> tuple[float, float]:
    """Peak displacement in m and peak velocity in m/s of a sine."""
    w = 2.0 * np.pi * frequency
    return level_g * STANDARD_GRAVITY / w**2, level_g * STANDARD_GRAVITY / w


def combined(contributions: ArrayLike) -> float:
    """Combined standard uncertainty of independent contributions: root sum of squares (GUM, 5.1.2)."""
    return float(np.sqrt(np.sum(np.square(np.asarray(contributions, dtype=np.float64)))))
