"""Power spectral density, one-sided, and the Allan variance that follows from it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import Array


@dataclass(frozen=True)
class Spectrum:
    """One-sided power spectral density; its integral over frequency is the variance."""

    frequency: Array
    """(f,) Hz"""
    density: Array
    """(..., f) unit²/Hz"""

    @property
    def amplitude(self) -> Array:
        """Noise density (..., f), unit/√Hz, as data sheets give it (one-sided)."""
        return np.sqrt(self.density)


def one_sided(x: ArrayLike, rate_hz: float, *, segment: int | None = None) -> Spectrum:
    """One-sided spectrum of records (..., n) by Welch's average of half-overlapping Hann segments, mean taken out.

    P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70.

    Parameters
    ----------
    x : (..., n), unit of the output
    rate_hz : Hz
    segment : samples; default an eighth of the record
    """
    data = np.asarray(x, dtype=np.float64)
    length = data.shape[-1] // 8 if segment is None else segment
    if not 8 <= length <= data.shape[-1]:
        raise ValueError(
            f"psd: segment of {length} samples in a record of {data.shape[-1]}, 8 or more must fit; record longer"
        )
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    density = np.zeros((*data.shape[:-1], length // 2 + 1))
    starts = range(0, data.shape[-1] - length + 1, length - length // 2)
    for start in starts:
        part = data[..., start : start + length]
        lines = np.fft.rfft(window * (part - part.mean(axis=-1, keepdims=True)))
        density += lines.real**2 + lines.imag**2
    density /= len(starts) * rate_hz * float(window @ window)
    density[..., 1 : (length + 1) // 2] *= (
        2.0  # the mean, and the highest line of an even segment, have no negative twin
    )
    return Spectrum(frequency=np.arange(length // 2 + 1, dtype=np.float64) * rate_hz / length, density=density)


def allan_variance(frequency: Array, density: Array, tau: Array) -> Array:
    """Allan variance (..., t) of a one-sided density: 2·∫ S(f)·sin⁴(πfτ)/(πfτ)² df.

    IEEE Std 952-1997, C.1 (there 4·∫ with the two-sided density). The density must resolve 1/tau and reach well above it.

    Parameters
    ----------
    frequency : (f,) Hz, increasing
    density : (..., f) unit²/Hz, one-sided
    tau : (t,) s
    """
    phase = np.pi * frequency[:, None] * tau
    kernel = np.sin(phase) ** 4 / np.where(phase > 0.0, phase, 1.0) ** 2
    return np.asarray(2.0 * np.trapezoid(density[..., :, None] * kernel, frequency, axis=-2))
