"""Noise of dwell means, estimated from the low-frequency end of the spectrum of the samples in each dwell."""

from collections.abc import Sequence

import numpy as np

from inertial.arrays import Array
from inertial.estimation.noise_shares import moderated

_LINES = 4
"""Spectral lines of a dwell, at 1/T to 4/T, that represent the noise of its mean: fewer scatter more, more are too fast."""

FEWEST_SAMPLES = 2 * _LINES + 1
"""Smallest number of samples of a dwell for these lines."""


def slow_deviation(dwells: Sequence[Array]) -> Array:
    """Equivalent white standard deviation per sample, (m, k), that gives the mean of each of m dwells its noise.

    The mean is the spectral line at zero frequency. The lines next to it have the same noise density, and the same leakage from
    a vibration at much higher frequency. The scatter of the samples shows neither: the vibration of an engine averages out, the
    breath of a wearer does not. The few lines of a dwell are shrunk towards those of the others as far as the dwells agree.

    Parameters
    ----------
    dwells : equally spaced samples (n, k) of each dwell, n at least :data:`FEWEST_SAMPLES`; the result has their unit
    """
    # a sine and a cosine of each frequency, each with the variance of a sample if the noise is white
    lines = [2.0 / len(x) * np.abs(np.fft.rfft(x - x[0], axis=0)[1 : _LINES + 1]) ** 2 for x in dwells]
    squares = np.stack([line.sum(axis=0) for line in lines])
    for of_output in squares.T:
        moves = of_output > 0.0  # a dwell whose output stays at one digit says nothing about the noise of the others
        if moves.any():
            of_output[moves] = moderated(of_output[moves], np.full(int(moves.sum()), 2.0 * _LINES))[0]
    return np.sqrt(squares)
