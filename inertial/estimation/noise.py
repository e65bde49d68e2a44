"""The kinds of wander between dwells, as covariances in real time.

1/f is a sum of Ornstein–Uhlenbeck processes of equal variance with time constants an octave apart: its spectrum is 1/f
between the slowest and the fastest.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONGEST = 1500
"""Largest number of dwells with a model of wander: its covariance must fit into memory. Long runs are averaged before."""


def walk_kernel(time: Array) -> Array:
    """Covariance of a random walk, zero at the first of all times (..., n) and of variance one at the last, (..., n, n)."""
    since = (time - time.min()) / max(float(np.ptp(time)), 1.0)
    return np.minimum(since[..., :, None], since[..., None, :])
