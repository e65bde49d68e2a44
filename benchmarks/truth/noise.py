"""Noise of the dwell means: white, 1/f by synthesis over the whole run in real time, random walk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def flicker_series(rng: np.random.Generator, channels: int, length: int, *, fractional: bool) -> Floats:
    """1/f noise, (channels, length), unit variance inside the record in expectation.

    Two ways, neither a sum of relaxations: half-order fractional summation of white noise (Kasdin, Proc. IEEE 83(5), 1995,
    eq. 104 with alpha = 1), or random phases on a 1/f spectrum. Both run over four times the record, so that the record holds
    wander slower than itself.
    """
    total = 4 * length
    if fractional:
        order = np.arange(1, total)
        response = np.concatenate([[1.0], np.cumprod((order - 0.5) / order)])
        white = rng.standard_normal((channels, total))
        size = 2 * total
        series = np.fft.irfft(np.fft.rfft(white, size) * np.fft.rfft(response, size), size)[:, :total]
    else:
        bins = total // 2 + 1
        spectrum = rng.standard_normal((channels, bins)) + 1j * rng.standard_normal((channels, bins))
        spectrum[:, 0] = 0.0
        spectrum[:, 1:] /= np.sqrt(np.arange(1, bins))
        series = np.fft.irfft(spectrum, total)
    record = series[:, -length:]
    return record / record.std(axis=1).mean()


def walk_series(rng: np.random.Generator, channels: int, length: int) -> Floats:
    """Random walk, (channels, length), unit standard deviation inside the record on the average."""
    series = np.cumsum(rng.standard_normal((channels, length)), axis=1)
    return series / series.std(axis=1).mean()
