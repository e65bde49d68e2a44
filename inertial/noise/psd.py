"""Power spectral density, one-sided, and the Allan variance that follows from it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import median_filter

from inertial.arrays import Array, runs_of
from inertial.distributions import chi2_upper

BESIDE = 15  # frequencies on each side of one, by whose median a line is seen
HANN_OVERLAP = 1.0 / 36.0  # squared correlation of half-overlapping Hann segments (Welch 1967)
CHANCE = 1e-6
"""Probability of a line in a record that has none."""


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


def spectral_lines(spectrum: Spectrum, samples: int) -> list[tuple[float, float]]:
    """Frequency, Hz, and root mean square of each line of one record of ``samples``, in order of frequency.

    A line stands out of the median of the 31 frequencies about it beyond what an average of χ² allows by chance in one record of
    a million. Below the sixteenth frequency of the segment nothing is told: there a drift is as narrow.
    """
    density, count = spectrum.density, spectrum.density.size
    if count < 4 * BESIDE:
        return []
    segments = max(1, samples // (count - 1) - 1)  # half overlapping
    dof = 2.0 * segments / (1.0 + 2.0 * HANN_OVERLAP * (segments > 1))
    usual = median_filter(density, 2 * BESIDE + 1, mode="nearest") / (1.0 - 2.0 / (9.0 * dof)) ** 3
    above = density > usual * float(chi2_upper(CHANCE / count, dof)) / dof
    above[: BESIDE + 1] = False
    found: list[tuple[float, float]] = []
    for start, stop in zip(*runs_of(above), strict=True):
        around = slice(max(int(start) - 1, 0), int(stop) + 1)
        peak = int(start) + int(np.argmax(density[start:stop]))
        power = float(np.sum(density[around] - usual[around]) * spectrum.frequency[1])
        found.append((float(spectrum.frequency[peak]), float(np.sqrt(max(power, 0.0)))))
    return found


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
