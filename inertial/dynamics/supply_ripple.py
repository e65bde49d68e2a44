"""Ripple of the supply in the output: the line at its frequency, and how much smaller it is (power-supply rejection)."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend

from inertial.arrays import Array
from inertial.dynamics.sine_fit import fit_tone, fit_tone_and_frequency

CLEAR = 8.0
"""Standard uncertainties by which a line must stand out for its own frequency to be searched."""
HARMONICS = 3
NEAREST, FARTHEST = 2, 14
"""Lines on both sides, in steps of one over the record, of which the noise is estimated: to a tenth from 24 of them."""


@dataclass(frozen=True)
class Line:
    """Amplitude of a line without the share of the noise, and its standard uncertainty, both in the unit of the record."""

    amplitude: float
    error: float


def ripple_line(record: Array, rate_hz: float, frequency: float) -> Line:
    """The line at a frequency in Hz of a record (n,).

    The noise is that of the lines beside it, since 1/f noise is louder at low frequencies. Alone it gives an amplitude, too,
    whose mean square is twice the variance of each component: it is taken off.

    Raises
    ------
    NotIdentified
        The record has fewer than eight samples.
    """
    column = record[:, None]
    tone = fit_tone(column, rate_hz, frequency, harmonics=HARMONICS)
    if abs(tone.value[0]) > CLEAR * tone.amplitude_error[0]:  # the recorder has a clock of its own
        tone = fit_tone_and_frequency(column, rate_hz, frequency, harmonics=HARMONICS)
    error = _noise_beside(record, rate_hz, complex(tone.value[0]), tone.frequency)
    return Line(float(np.sqrt(max(abs(tone.value[0]) ** 2 - 2.0 * error**2, 0.0))), error)


def _noise_beside(record: Array, rate_hz: float, value: complex, frequency: float) -> float:
    """Standard deviation of a component of the lines beside a tone, which is taken out first."""
    time = np.arange(len(record)) / rate_hz
    left = np.asarray(detrend(record - np.real(value * np.exp(2j * np.pi * frequency * time))))
    steps = np.concatenate([-np.arange(NEAREST, FARTHEST), np.arange(NEAREST, FARTHEST)])
    beside = frequency + steps * rate_hz / len(record)
    beside = beside[beside > rate_hz / len(record)]
    lines = 2.0 / len(record) * (np.exp(-2j * np.pi * beside[:, None] * time) @ left)
    return float(np.sqrt(0.5 * np.mean(np.abs(lines) ** 2)))


def rejection_db(ripple: Line, output: Line) -> tuple[float, float]:
    """20·log10 of the ripple over the output, both in V, and its standard uncertainty, dB.

    A line that does not stand out of its noise counts as large as its uncertainty: the rejection is at least about that.
    """
    seen = max(output.amplitude, output.error)
    share = float(np.hypot(output.error / seen, ripple.error / ripple.amplitude))
    return 20.0 * float(np.log10(ripple.amplitude / seen)), 20.0 / float(np.log(10.0)) * share
