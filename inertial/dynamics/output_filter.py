"""Low-pass filters behind a sensor: second-order Butterworth, linear-phase FIR, moving average, sample by sample with a state."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from scipy.optimize import brentq
from scipy.signal import butter, firwin, lfilter, lfilter_zi

from inertial.arrays import Array

Kind = Literal["butterworth", "fir", "moving-average"]
KINDS: tuple[Kind, ...] = get_args(Kind)
HIGHEST = 0.4
"""Largest cut-off over the rate: nearer to half the rate a filter has no room to fall."""
MOST_TAPS = 1023
_HALF = float(np.sqrt(0.5))
_TAPS_OF_CUTOFF = 2.2
"""Taps of the FIR filter times cut-off over rate: its stop band begins at 2.1 times the cut-off."""


@dataclass(frozen=True)
class OutputFilter:
    """A filter y = Σ b·x − Σ a·y of the samples of one rate.

    numerator, denominator : (n,), b and a, a[0] = 1, of one length · rate_hz : of the samples
    """

    kind: Kind
    rate_hz: float
    numerator: Array
    denominator: Array

    @property
    def cutoff_hz(self) -> float:
        """Frequency at which the power has fallen to a half (−3 dB), Hz."""
        top = 0.5 * self.rate_hz
        grid = np.linspace(1e-4 * top, top, 4001)
        below = np.flatnonzero(self._size(grid) < _HALF)
        if not below.size or below[0] == 0:
            return float(grid[0] if below.size else top)
        low, high = float(grid[below[0] - 1]), float(grid[below[0]])
        edge: Any = brentq(lambda f: float(self._size(np.array([f]))[0]) - _HALF, low, high)
        return float(edge)

    @property
    def delay_s(self) -> float:
        """Group delay at 0 Hz, s: Σ k·b/Σ b − Σ k·a/Σ a samples."""
        k = np.arange(self.numerator.size)
        samples = k @ self.numerator / self.numerator.sum() - k @ self.denominator / self.denominator.sum()
        return float(samples) / self.rate_hz

    @property
    def noise_gain(self) -> float:
        """Variance of white noise behind the filter over that before it, Σ h²."""
        length = self.numerator.size if self.kind != "butterworth" else int(60.0 * self.rate_hz / self.cutoff_hz) + 64
        impulse = np.zeros(length)
        impulse[0] = 1.0
        response = np.asarray(lfilter(self.numerator, self.denominator, impulse), dtype=np.float64)
        return float(response @ response)

    @property
    def noise_bandwidth_hz(self) -> float:
        """Width of the ideal low-pass that passes as much white noise, Hz."""
        return 0.5 * self.rate_hz * self.noise_gain

    def _size(self, frequency: Array) -> Array:
        turn = np.exp(-2j * np.pi * np.outer(frequency / self.rate_hz, np.arange(self.numerator.size)))
        return np.abs(turn @ self.numerator / (turn @ self.denominator))

    def steady(self, value: Array) -> Array:
        """The state (m, k) of a filter that has seen a constant value (k,) for ever."""
        return lfilter_zi(self.numerator, self.denominator)[:, None] * np.asarray(value, dtype=np.float64)

    def apply(self, samples: Array, state: Array) -> tuple[Array, Array]:
        """The filtered samples (n, k), and the state (m, k) after them, with which the next samples go on."""
        return lfilter(self.numerator, self.denominator, samples, axis=0, zi=state)


def designed(kind: Kind, cutoff_hz: float, rate_hz: float) -> OutputFilter:
    """The filter of a kind whose power has fallen to a half at a frequency.

    A moving average has a whole number of samples, so that its cut-off is the nearest one: 0.443 of the rate over their number.

    Raises
    ------
    ValueError
        The cut-off is not between 0 and :data:`HIGHEST` of the rate, or needs more than :data:`MOST_TAPS`.
    """
    share = cutoff_hz / rate_hz
    if not 0.0 < share <= HIGHEST:
        raise ValueError(
            f"cut-off {cutoff_hz:g} Hz at {rate_hz:g} Hz, above 0 and at most {HIGHEST * rate_hz:g} Hz is needed"
        )
    if kind == "butterworth":
        pair: Any = butter(2, cutoff_hz, fs=rate_hz)
        return OutputFilter(kind, rate_hz, np.asarray(pair[0], dtype=np.float64), np.asarray(pair[1], dtype=np.float64))
    count = (
        2 * round(0.5 * _TAPS_OF_CUTOFF / share) + 1
        if kind == "fir"
        else max(2, round(np.sqrt(1.0 + (0.4429 / share) ** 2)))
    )
    if count > MOST_TAPS:
        raise ValueError(
            f"cut-off {cutoff_hz:g} Hz at {rate_hz:g} Hz takes {count} samples, at most {MOST_TAPS}; choose butterworth"
        )
    if kind == "moving-average":
        return _of_taps(kind, rate_hz, np.full(count, 1.0 / count))

    def off(edge: float) -> float:
        return _of_taps(kind, rate_hz, firwin(max(count, 5), edge, fs=rate_hz)).cutoff_hz - cutoff_hz

    low, high = 0.2 * cutoff_hz, min(2.0 * cutoff_hz, 0.499 * rate_hz)
    edge = brentq(off, low, high, xtol=1e-6 * cutoff_hz) if off(low) < 0.0 < off(high) else cutoff_hz
    return _of_taps(kind, rate_hz, firwin(max(count, 5), edge, fs=rate_hz))


def _of_taps(kind: Kind, rate_hz: float, taps: Any) -> OutputFilter:
    taps = np.asarray(taps, dtype=np.float64)
    return OutputFilter(kind, rate_hz, taps, np.concatenate([[1.0], np.zeros(taps.size - 1)]))
