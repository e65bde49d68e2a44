"""In frequency: densities by breakpoints, their confidence, rectification, folding, exciters, the second-order accelerometer."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal
from scipy.stats import chi2

from inertial.arrays import Array, Complex

STANDARD_GRAVITY = 9.80665  # m/s²
HANN_HALF = 0.945
"""Independent averages per segment for a Hann window with half overlap (Welch 1967)."""


def density_confidence(averages: float) -> tuple[float, float]:
    """Deviations in dB, low and high, between which a density estimate lies with 99 %: χ² with 2n degrees of freedom over 2n."""
    dof = 2.0 * averages
    low, high = chi2.ppf([0.5 - 0.5 * 0.99, 0.5 + 0.5 * 0.99], dof) / dof
    return float(10.0 * np.log10(low)), float(10.0 * np.log10(high))


def hann_mean(record: Array) -> Array:
    """Mean (channels,) of a record (n, channels) with a Hann weight: vibration without power near 0 Hz hardly leaks into it."""
    made: Any = signal.get_window("hann", len(record), fftbins=False)
    w = np.asarray(made, dtype=np.float64)
    return np.asarray(w @ record / w.sum())


def folded_share(rate_hz: float, bandwidth_hz: float, order: int, damping: float = 0.7) -> float:
    """Share of the pass-band gain that folds onto the band edge: the gain at f_s − f_B.

    Parameters
    ----------
    order : of what limits the bandwidth: 1 one pole, 2 a second-order system with ``damping``, else a Butterworth low-pass
    """
    f = rate_hz - bandwidth_hz
    if order == 1:
        return float(1.0 / np.hypot(1.0, f / bandwidth_hz))
    if order == 2:
        return float(np.abs(transfer(f, bandwidth_hz / bandwidth(1.0, damping), damping)))
    return float(1.0 / np.sqrt(1.0 + (f / bandwidth_hz) ** (2 * order)))


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


def bandwidth(natural_hz: float, damping: float) -> float:
    """Frequency in Hz where |H|² has fallen to half of its static value, the −3 dB point.

    (1 - r²)² + 4ζ²r² = 2 solved for r = f/f_n: √(q + √(q² + 1)) with q = 1 − 2ζ².
    """
    q = 1.0 - 2.0 * damping**2
    return natural_hz * float(np.sqrt(q + np.sqrt(q**2 + 1.0)))


def largest_level(frequency: ArrayLike, *, displacement_m: float, velocity_m_s: float, acceleration_g: float) -> Array:
    """Largest peak acceleration in g at frequencies in Hz: the least of ω²·displacement, ω·velocity and the limit."""
    w = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)
    return np.minimum(np.minimum(w**2 * displacement_m, w * velocity_m_s) / STANDARD_GRAVITY, acceleration_g)


def segment_power(f1: float, p1: float, f2: float, p2: float) -> float:
    """Mean square in g² of a density that is straight on log–log paper from (f₁, p₁) to (f₂, p₂)."""
    if f2 <= f1:
        return 0.0
    m = np.log(p2 / p1) / np.log(f2 / f1)
    if abs(m + 1.0) < 1e-9:
        return float(p1 * f1 * np.log(f2 / f1))
    return float(p1 * f1 / (m + 1.0) * ((f2 / f1) ** (m + 1.0) - 1.0))


def overall_level(frequency: Array, density: Array) -> float:
    """Overall level in g rms of breakpoints (n,) in Hz and g²/Hz, straight on log–log paper between them."""
    f, p = frequency.tolist(), density.tolist()
    return float(np.sqrt(sum(segment_power(f[k], p[k], f[k + 1], p[k + 1]) for k in range(len(f) - 1))))


def interpolated(at: Array, frequency: Array, density: Array) -> Array:
    """Density (m,) in g²/Hz at frequencies (m,) in Hz; 0 outside the breakpoints."""
    inside = (at >= frequency[0]) & (at <= frequency[-1])
    safe = np.where(inside, at, frequency[0])
    return np.where(inside, np.exp(np.interp(np.log(safe), np.log(frequency), np.log(density))), 0.0)


def rectification(level_g: Array, shift_g: Array, error_g: Array) -> tuple[float, float, float]:
    """Vibration rectification coefficient in g/g², its standard uncertainty, and χ² of the line through the origin.

    Parameters
    ----------
    level_g, shift_g, error_g : (n,), overall level in g rms, bias in vibration minus bias before, its standard uncertainty in g
    """
    x = level_g**2
    w = error_g**-2.0
    value = float(np.sum(w * x * shift_g) / np.sum(w * x**2))
    return value, float(np.sum(w * x**2) ** -0.5), float(np.sum(w * (shift_g - value * x) ** 2))
