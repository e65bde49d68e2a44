"""The kinds of wander between dwells, as covariances in real time.

1/f is a sum of Ornstein–Uhlenbeck processes of equal variance with time constants an octave apart: its spectrum is 1/f
between the slowest and the fastest.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONGEST = 1500
"""Dwells beyond which the wander is left out: its covariance would not fit. Long runs are averaged before they are judged."""


def flicker_kernel(time: Array, *, slowest: float = 4.0) -> Array:
    """Correlation matrix of 1/f wander at times ``time`` (..., n) in s, (..., n, n).

    Time constants run in octaves from a third of the typical spacing to ``slowest`` times the length of the record.
    """
    gap = np.abs(time[..., :, None] - time[..., None, :])
    span = float(np.max(gap, initial=1.0))
    spacing = max(float(np.median(np.diff(np.unique(time)))) if np.unique(time).size > 1 else 1.0, span / 1e5, 1e-6)
    octaves = max(int(np.ceil(np.log2(slowest * span / (spacing / 3.0)))), 2)
    taus = slowest * span * 0.5 ** np.arange(octaves)
    kernel = np.zeros(gap.shape)
    for tau in taus:
        kernel += np.exp(-gap / tau)
    return kernel / taus.size


def walk_kernel(time: Array) -> Array:
    """Covariance of a random walk, zero at the first of all times (..., n) and of variance one at the last, (..., n, n)."""
    since = (time - time.min()) / max(float(np.ptp(time)), 1.0)
    return np.minimum(since[..., :, None], since[..., None, :])
