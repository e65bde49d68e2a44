"""Sine fits of one tone: three parameters with drift, the fourth (frequency), harmonics; standard uncertainties.

ISO 16063-11 method 3, IEEE 1057: least squares on [cos ωt, sin ωt, 1]; a linear term is added, since a drift d over n whole
periods errs by up to d/(πn).
"""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Complex
from inertial.errors import NotIdentified

ROUNDS = 12
HARMONICS = 5


@dataclass(frozen=True)
class Tone:
    """A tone in several channels.

    value : (channels,), complex amplitude: the real part belongs to cos ωt, minus the imaginary part to sin ωt
    sigma : (channels,), residual standard deviation of a sample
    amplitude_error : (channels,), σ√(2/N); the phase's in rad is this over the amplitude
    frequency, frequency_error : Hz on the channel's own time base; the error is 0 where the frequency was given, and infinite
        where no channel moves
    """

    value: Complex
    sigma: Array
    amplitude_error: Array
    frequency: float
    frequency_error: float = 0.0


def fit_tone(record: Array, rate_hz: float, frequency: float, *, harmonics: int = 1) -> Tone:
    """The tone of a known frequency in every channel, by least squares with constant and drift.

    Parameters
    ----------
    record : (n, channels), any unit
    rate_hz, frequency : Hz
    harmonics : highest one that is fitted beside the tone, below half the rate; distortion of an exciter is no noise of a sample
    """
    n = len(record)
    if n < 8:
        raise NotIdentified(f"sine fit: {n} samples, 8 or more are needed; record longer")
    time = np.arange(n) / rate_hz
    design = np.hstack([_columns(time, frequency), *_harmonics(time, rate_hz, frequency, harmonics)])
    c, left = _projected(design, record)
    sigma = np.sqrt(np.sum(left**2, axis=0) / (n - design.shape[1]))
    return Tone(c[0] - 1j * c[1], sigma, sigma * np.sqrt(2.0 / n), frequency)


def fit_tone_and_frequency(record: Array, rate_hz: float, frequency: float, *, harmonics: int = 1) -> Tone:
    """The tone and its frequency, common to all channels: Gauss–Newton on the fourth parameter.

    A device with a clock of its own sees another frequency; 1000 ppm at 1 kHz over 1 s would null a fit at the given one. The
    search begins at the largest value of a fine periodogram within ± 2 % of the given frequency.
    The phase refers to the first sample. ``harmonics`` is as for :func:`fit_tone`.
    """
    n = len(record)
    time = np.arange(n) / rate_hz
    span = n / rate_hz
    f = _coarse(record, time, frequency, span)
    error = np.inf
    for _ in range(ROUNDS):
        design = np.hstack([_columns(time, f), *_harmonics(time, rate_hz, f, harmonics)])
        c, left = _projected(design, record)
        turned = design[:, [1]] * c[0] - design[:, [0]] * c[1]
        slope = _projected(design, -2.0 * np.pi * time[:, None] * turned)[1]  # derivative by the frequency
        variance = np.sum(left**2, axis=0) / max(1, n - design.shape[1])
        weight = 1.0 / np.maximum(variance, 1e-300)
        information = float(np.sum(weight * np.sum(slope**2, axis=0)))
        if information == 0.0:  # no channel moves: the frequency stays unknown
            break
        step = float(np.sum(weight * np.sum(slope * left, axis=0))) / information
        error = information**-0.5
        f += float(np.clip(step, -0.25 / span, 0.25 / span))
        if abs(step) < 1e-3 * error:
            break
    tone = fit_tone(record, rate_hz, f, harmonics=harmonics)
    return Tone(tone.value, tone.sigma, tone.amplitude_error, f, error)


def harmonic_distortion(record: Array, rate_hz: float, frequency: float) -> Array:
    """Total harmonic distortion of every channel, a share: harmonics 2 to 5 below half the rate over the fundamental."""
    time = np.arange(len(record)) / rate_hz
    parts = [_columns(time, frequency), *_harmonics(time, rate_hz, frequency, HARMONICS)]
    c, _ = _projected(np.hstack(parts), record)
    fundamental = np.hypot(c[0], c[1])
    return np.sqrt(np.sum(c[4:] ** 2, axis=0)) / np.where(fundamental > 0.0, fundamental, np.inf)


def _projected(design: Array, record: Array) -> tuple[Array, Array]:
    """Coefficients (terms, channels) of least squares and residuals (n, channels).

    By the normal equations, with one correction from the residuals: the columns of tones over several periods are nearly
    orthogonal, and a decomposition of all samples takes ten times as long.
    """
    gram = design.T @ design
    c = np.linalg.lstsq(gram, design.T @ record, rcond=None)[0]
    c = c + np.linalg.lstsq(gram, design.T @ (record - design @ c), rcond=None)[0]
    return c, record - design @ c


def _columns(time: Array, frequency: float) -> Array:
    turn = 2.0 * np.pi * frequency * time
    drift = (time - time.mean()) / max(float(np.ptp(time)), 1e-300)
    return np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(time), drift])


def _harmonics(time: Array, rate_hz: float, frequency: float, last: int) -> list[Array]:
    """Columns (n, 2) of every harmonic from the second to the last, as far as the rate holds them."""
    turns = [2.0 * np.pi * k * frequency * time for k in range(2, last + 1) if k * frequency < 0.49 * rate_hz]
    return [np.column_stack([np.cos(turn), np.sin(turn)]) for turn in turns]


def _coarse(record: Array, time: Array, frequency: float, span: float) -> float:
    """The frequency within ± 2 % of the given one at which the channels hold most power."""
    y = record - record.mean(axis=0)
    y = y / np.maximum(np.sqrt(np.mean(y**2, axis=0)), 1e-300)
    reach = max(0.02 * frequency, 0.5 / span)
    grid = np.linspace(frequency - reach, frequency + reach, 2 * int(np.ceil(4.0 * reach * span)) + 1)
    grid = grid[grid > 0.0]
    power = np.array([np.sum(np.abs(np.exp(-2j * np.pi * f * time) @ y) ** 2) for f in grid])
    return float(grid[int(np.argmax(power))])
