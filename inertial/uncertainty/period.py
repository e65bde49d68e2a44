"""The bias over a period of validity: flicker to the due date, ageing, switching on; and over the run for comparison.

Flicker of bias instability B has the one-sided density B²/(π·f). Without a slowest time constant it goes on to the due date
(:func:`inertial.noise.measurands.between_means`); with one, it is a sum of Ornstein–Uhlenbeck processes an octave apart.
"""

from dataclasses import dataclass

import numpy as np

from inertial.noise.flicker import flicker_of_means
from inertial.noise.measurands import between_means

YEAR_S = 31_557_600.0
MONTH_S = YEAR_S / 12.0
DAY_S = 86_400.0


@dataclass(frozen=True)
class Windows:
    """Times of a calibration and its use, s: length of the calibration, of a use, and between the two."""

    calibration: float
    use: float
    gap: float


def flicker_later(windows: Windows, slowest: float | None = None) -> float:
    """Standard deviation of the flicker between calibration and a use after the gap, for B = 1."""
    a, b, gap = windows.calibration, windows.use, windows.gap
    if slowest is None:
        return float(np.sqrt(between_means(a, b, gap)))
    apart = _covariance(gap + 0.5 * (a + b), b, slowest)
    return float(np.sqrt(max(_covariance(0.0, a, slowest) + _covariance(0.0, b, slowest) - 2.0 * apart, 0.0)))


def flicker_within(windows: Windows, slowest: float | None = None) -> float:
    """Standard deviation of the flicker between the mean of the calibration and a use inside it, for B = 1: B·√(ln(a/b)/π)."""
    a, b = windows.calibration, windows.use
    if slowest is None:
        return float(np.sqrt(max(np.log(a / b), 0.0) / np.pi))
    return float(np.sqrt(max(_covariance(0.0, b, slowest) - _covariance(0.0, a, slowest), 0.0)))


def _covariance(apart: float, length: float, slowest: float) -> float:
    """Of the means over two windows of a length that are so far apart, for B = 1."""
    return float(flicker_of_means(np.array([apart]), length, max(slowest, 0.03 * length))[0])


def walk_later(windows: Windows) -> float:
    """Standard deviation of a random walk between calibration and use, for K = 1/√s: u² = a/3 + g + b/3."""
    return float(np.sqrt(windows.calibration / 3.0 + windows.gap + windows.use / 3.0))


def bounded_walk(deviation: float, correlation: float, gap: float) -> float:
    """Standard deviation of a change of a walk that is bounded: √(2·s²·(1 − e^(−t/T_c))); the unit of s."""
    return deviation * float(np.sqrt(2.0 * -np.expm1(-gap / correlation)))


def logarithmic(per_decade: float, gap: float) -> float:
    """Change by ageing A·log₁₀(1 + t/day), the unit of A."""
    return per_decade * float(np.log10(1.0 + gap / DAY_S))
