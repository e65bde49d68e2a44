"""Random vibration: densities by breakpoints, their overall level, and the rectification coefficient."""

import numpy as np

from inertial.arrays import Array


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
