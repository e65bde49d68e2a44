"""Noise of the means of dwells, from the samples inside them: what they scatter by at the slow end of their spectrum."""

from collections.abc import Sequence

import numpy as np

from inertial.arrays import Array
from inertial.estimation.noise_shares import moderated

_LINES = 4
"""Lines of a dwell's spectrum, at 1/T to 4/T, that stand for its mean: fewer are known badly, more are faster than it."""

FEWEST_SAMPLES = 2 * _LINES + 1
"""Samples that a dwell needs for them."""


def slow_deviation(dwells: Sequence[Array]) -> Array:
    """Standard deviations (m, k) of white noise that scatters the mean of each of m dwells as its slow noise does.

    The mean is the line at zero of a dwell's spectrum. The lines next to it hold as much noise, and as much as the mean of what
    leaks from a vibration far above them. The scatter of the samples tells neither: an engine that shakes them averages out, the
    breath of a wrist does not. The few lines of a dwell are shrunk to those of the others as far as the dwells are alike.

    Parameters
    ----------
    dwells : samples (n, k) of each, :data:`FEWEST_SAMPLES` at least, equally spaced
    """
    # a sine and a cosine of each frequency, each with the variance of a sample if the noise is white
    lines = [2.0 / len(x) * np.abs(np.fft.rfft(x - x[0], axis=0)[1 : _LINES + 1]) ** 2 for x in dwells]
    squares = np.stack([line.sum(axis=0) for line in lines])
    for of_output in squares.T:
        moves = of_output > 0.0  # an output that stays at one digit tells nothing of the others
        if moves.any():
            of_output[moves] = moderated(of_output[moves], np.full(int(moves.sum()), 2.0 * _LINES))[0]
    return np.sqrt(squares)
