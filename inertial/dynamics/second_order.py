"""The second-order accelerometer in frequency: response and bandwidth."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
