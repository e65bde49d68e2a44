"""Spectra of two channels: response by H1 and H2, coherence with its number of averages, densities and their confidence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.stats import chi2

from inertial.dynamics.second_order import bandwidth, transfer
from inertial.errors import NotIdentified

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
HANN_HALF = 0.945
"""Independent averages per segment for a Hann window with half overlap (Welch 1967)."""


@dataclass(frozen=True)
class Response:
    """Response of a channel to another.

    Attributes
    ----------
    frequency : (n,), Hz
    h1, h2 : (n,), complex; h1 is right for noise on the output, h2 for noise on the input
    coherence : (n,); unrelated signals show 1/averages
    averages : number of independent averages
    error : (n,), relative standard uncertainty of the magnitude of h1, and of its phase in rad
    """

    frequency: Array
    h1: Complex
    h2: Complex
    coherence: Array
    averages: float
    error: Array


def response(reference: Array, output: Array, rate_hz: float, *, segment: int, delay_s: float = 0.0) -> Response:
    """H1, H2 and coherence by Welch's method with a Hann window and half overlap.

    Parameters
    ----------
    reference, output : (n,)
    segment : samples of a segment
    delay_s : known delay of the output, taken out before and put back into the phase: left in, it biases the magnitude low

    Raises
    ------
    NotIdentified
        The record has too few segments: one segment alone shows a coherence of exactly 1.
    """
    shift = round(delay_s * rate_hz)
    if shift:
        reference, output = (reference[:-shift], output[shift:]) if shift > 0 else (reference[-shift:], output[:shift])
    count = (len(reference) - segment // 2) // (segment - segment // 2)
    if count < 4:
        msg = (
            f"response: {count} segments, 4 or more are needed for a coherence; record longer, or shorten the segments"
        )
        raise NotIdentified(msg)
    options: dict[str, Any] = {"fs": rate_hz, "window": "hann", "nperseg": segment, "noverlap": segment // 2}
    f, sxx = signal.welch(reference, **options)
    syy = signal.welch(output, **options)[1]
    sxy = signal.csd(reference, output, **options)[1]
    coherence = np.clip(np.abs(sxy) ** 2 / (sxx * syy), 0.0, 1.0)
    averages = HANN_HALF * count
    turn = np.exp(-2j * np.pi * f * shift / rate_hz)
    h1 = np.asarray(sxy / sxx * turn, dtype=np.complex128)
    with np.errstate(all="ignore"):
        h2 = np.asarray(syy / np.conj(sxy) * turn, dtype=np.complex128)
        error = np.sqrt((1.0 - coherence) / (2.0 * coherence * averages))
    return Response(f, h1, h2, coherence, averages, error)


def density_confidence(averages: float, level: float = 0.99) -> tuple[float, float]:
    """Deviations in dB, low and high, between which a density estimate lies: χ² with 2n degrees of freedom over 2n."""
    dof = 2.0 * averages
    low, high = chi2.ppf([0.5 - 0.5 * level, 0.5 + 0.5 * level], dof) / dof
    return float(10.0 * np.log10(low)), float(10.0 * np.log10(high))


def hann_mean(record: Array) -> Array:
    """Mean (channels,) of a record (n, channels) with a Hann weight: vibration without power near 0 Hz hardly leaks into it."""
    made: Any = signal.get_window("hann", len(record), fftbins=False)
    w = np.asarray(made, dtype=np.float64)
    return np.asarray(w @ record / w.sum())


def butterworth(order: int) -> tuple[float, float, float]:
    """Noise bandwidth over f_c, delay at 0 Hz times ω_c, and overshoot of the step as a share, of a Butterworth low-pass."""
    made: Any = signal.butter(order, 1.0, analog=True)
    b, a = made
    noise = float(np.pi / 2.0 / order / np.sin(np.pi / 2.0 / order))
    delay = float(np.real(a[-2] / a[-1]))
    _, y = signal.step((b, a), T=np.linspace(0.0, 60.0, 60001))
    return noise, delay, float(max(0.0, np.max(y) - 1.0))


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
