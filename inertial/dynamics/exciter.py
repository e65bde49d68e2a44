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


TRANSVERSE = 1.0 / np.sqrt(18.0)
"""Standard uncertainty of S_T·a_T·cos β over the product of the maxima: both rectangular from 0, β uniform (0.2357)."""


def transverse_error(sensitivity_max: float, motion_max: float) -> float:
    """Relative standard uncertainty by transverse motion, from the largest transverse sensitivity and motion (shares)."""
    return float(TRANSVERSE * sensitivity_max * motion_max)


def combined(contributions: ArrayLike) -> float:
    """Combined standard uncertainty of independent contributions: root sum of squares (GUM, 5.1.2)."""
    return float(np.sqrt(np.sum(np.square(np.asarray(contributions, dtype=np.float64)))))


def settle_cycles_s(natural_hz: float, damping: float, filter_delay_s: float = 0.0) -> float:
    """Wait in s before a stepped-sine dwell counts: 5/(ζω_n) and the filter's delay."""
    return 5.0 / (damping * 2.0 * np.pi * natural_hz) + filter_delay_s


def sweep_rate_limit(natural_hz: float, q: float) -> tuple[float, float]:
    """Quarter of the sweep rates quoted from ISO 7626-2: Hz/min (linear) and octaves/min (logarithmic).

    At the full rate the peak is 6 % low and ζ from the width a quarter too high; at a quarter of it 1 % and 2–4 %.
    """
    return 0.25 * 54.0 * natural_hz**2 / q**2, 0.25 * 77.6 * natural_hz / q**2
