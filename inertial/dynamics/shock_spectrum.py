"""Shock response spectrum, absolute acceleration: ISO 18431-4, the ramp-invariant recursion after Smallwood."""

import numpy as np
from scipy.signal import lfilter

from inertial.arrays import Array
from inertial.errors import NotIdentified

PER_OCTAVE = 12
FEWEST_PER_PERIOD = 10.0


def octave_frequencies(low_hz: float, high_hz: float, per_octave: int = PER_OCTAVE) -> Array:
    """Frequencies (n,) in Hz from low to at most high, ``per_octave`` in an octave."""
    count = int(np.floor(per_octave * np.log2(high_hz / low_hz) + 1e-9)) + 1
    return low_hz * 2.0 ** (np.arange(count) / per_octave)


def responses(record: Array, rate_hz: float, natural_hz: float, q: float) -> Array:
    """Absolute acceleration (n,) of a base-excited oscillator with this natural frequency and Q (``inf``: undamped)."""
    damping = 0.0 if np.isinf(q) else 0.5 / q
    wn, t = 2.0 * np.pi * natural_hz, 1.0 / rate_hz
    wd = wn * np.sqrt(1.0 - damping**2)
    e, k = np.exp(-damping * wn * t), wd * t
    c, s = e * np.cos(k), e * np.sin(k)
    sp = s / k
    return np.asarray(lfilter([1.0 - sp, 2.0 * (sp - c), e**2 - sp], [1.0, -2.0 * c, e**2], record), dtype=np.float64)


def shock_spectrum(record: Array, rate_hz: float, natural_hz: Array, q: float = 10.0) -> Array:
    """Largest absolute response (m,), the maximax spectrum, in the record's unit.

    One period of the lowest frequency of zeros is added behind the record, so that the residual response is seen.

    Parameters
    ----------
    record : (n,), baseline already taken out
    natural_hz : (m,), Hz
    q : 1/(2ζ); ``inf`` for undamped oscillators

    Raises
    ------
    NotIdentified
        The sampling rate is below ten times the highest frequency: the maximum would be up to 8 % low.
    """
    highest = float(np.max(natural_hz))
    if rate_hz < FEWEST_PER_PERIOD * highest:
        raise NotIdentified(
            f"shock spectrum: {rate_hz:g} Hz for {highest:g} Hz, at least "
            f"{FEWEST_PER_PERIOD * highest:g} Hz is needed; lower the "
            "highest frequency, or sample faster"
        )
    tail = np.zeros(int(np.ceil(rate_hz / float(np.min(natural_hz)))) + 1)
    padded = np.concatenate([record, tail])
    return np.array([np.max(np.abs(responses(padded, rate_hz, float(f), q))) for f in natural_hz])
