"""The second-order accelerometer in frequency: response, bandwidth, damping from a peak, fit of the gain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inertial.errors import NotIdentified

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def transfer(frequency: ArrayLike, natural_hz: float, damping: float) -> Complex:
    """H(jω) = -1/((1 - (ω/ω_n)²) + 2jζω/ω_n) of a sprung mass, relative to its static answer's size.

    The sign is that of the displacement of the mass; an output that counts up with acceleration has -H.

    Parameters
    ----------
    frequency : (...), Hz
    natural_hz : Hz, undamped
    damping : ratio ζ
    """
    ratio = np.asarray(frequency, dtype=np.float64) / natural_hz
    return np.asarray(-1.0 / ((1.0 - ratio**2) + 2.0j * damping * ratio), dtype=np.complex128)


def bandwidth(natural_hz: float, damping: float, level: float = 0.5) -> float:
    """Frequency in Hz where |H|² has fallen to ``level`` of its static value; the −3 dB point by default.

    (1 - r²)² + 4ζ²r² = 1/level solved for r = f/f_n; with q = 1 − 2ζ² and level ½ it is √(q + √(q² + 1)).
    """
    q = 1.0 - 2.0 * damping**2
    return natural_hz * float(np.sqrt(q + np.sqrt(q**2 - 1.0 + 1.0 / level)))


def peak(damping: float) -> tuple[float, float]:
    """Height of the resonance over the static gain and its place f/f_n; 1 and 0 where there is none (ζ ≥ 0.7071)."""
    if damping >= np.sqrt(0.5):
        return 1.0, 0.0
    return float(0.5 / (damping * np.sqrt(1.0 - damping**2))), float(np.sqrt(1.0 - 2.0 * damping**2))


def damping_from_half_power(lower_hz: float, upper_hz: float) -> float:
    """Damping ratio from the half-power frequencies f₁, f₂ of the peak: sin(½·atan((f₂² − f₁²)/(f₂² + f₁²))).

    Exact for ζ < sin 22.5°: |H|² is half its largest value at r² = (1 − 2ζ²) ∓ 2ζ√(1 − ζ²) = cos 2φ ∓ sin 2φ with ζ = sin φ.
    """
    return float(np.sin(0.5 * np.arctan2(upper_hz**2 - lower_hz**2, upper_hz**2 + lower_hz**2)))


def damping_from_peak(frequency: ArrayLike, gain: ArrayLike) -> float:
    """Damping ratio from the width of the resonance at 1/√2 of its height, for ζ < 0.38, exact but for interpolation.

    Above 0.38 there are no two such points: use `fit_second_order`, or a fit of the complex curve.

    Parameters
    ----------
    frequency : (n,), Hz, increasing
    gain : (n,), |H|
    """
    f, size = np.asarray(frequency, dtype=np.float64), np.asarray(gain, dtype=np.float64)
    top = int(np.argmax(size))
    level = size[top] / np.sqrt(2.0)
    below, above = np.flatnonzero(size[:top] < level), np.flatnonzero(size[top:] < level)
    if below.size == 0 or above.size == 0:
        msg = "damping: the resonance never falls 3 dB on both sides of its peak; sweep wider, or fit the whole curve"
        raise NotIdentified(msg)
    left, right = int(below[-1]), top + int(above[0])
    f1 = float(np.interp(level, size[left : left + 2], f[left : left + 2]))
    f2 = float(np.interp(-level, -size[right - 1 : right + 1], f[right - 1 : right + 1]))
    return damping_from_half_power(f1, f2)


@dataclass(frozen=True)
class SecondOrder:
    """Result of a fit to the gain of a sine sweep."""

    natural_hz: float
    damping: float
    sensitivity: float
    """Static gain, output unit per g."""

    @property
    def bandwidth_hz(self) -> float:
        """-3 dB bandwidth, Hz."""
        return bandwidth(self.natural_hz, self.damping)


def fit_second_order(frequency: ArrayLike, gain: ArrayLike) -> SecondOrder:
    """Natural frequency, damping and sensitivity from the gain of a sweep, by linear least squares.

    1/|H|² = s⁻²·(1 + (4ζ² - 2)·r² + r⁴) is linear in 1, f², f⁴; each point weighs as its gain is known to a share.

    Parameters
    ----------
    frequency : (n,), Hz
    gain : (n,), output unit per g
    """
    f, size = np.asarray(frequency, dtype=np.float64), np.asarray(gain, dtype=np.float64)
    if f.size < 4 or not np.all(size > 0.0):
        msg = f"sweep: {f.size} points, four or more with a positive gain are needed; sweep more frequencies"
        raise NotIdentified(msg)
    unit = f / f.max()
    rows = np.column_stack([np.ones_like(unit), unit**2, unit**4]) * (size**2)[:, None]
    c = np.asarray(np.linalg.lstsq(rows, np.ones_like(unit), rcond=None)[0], dtype=np.float64)
    if c[0] <= 0.0 or c[2] <= 0.0:
        msg = f"sweep: the gain up to {f.max():.4g} Hz does not bend as a second-order system's; sweep beyond the resonance"
        raise NotIdentified(msg)
    natural = (c[0] / c[2]) ** 0.25
    square = 0.25 * (c[1] * natural**2 / c[0] + 2.0)
    return SecondOrder(float(natural * f.max()), float(np.sqrt(max(square, 0.0))), float(1.0 / np.sqrt(c[0])))
