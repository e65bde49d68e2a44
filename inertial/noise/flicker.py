"""Flicker (1/f) noise as a sum of Ornstein–Uhlenbeck processes whose time constants are a fixed ratio apart."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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


_FASTEST = 0.01
"""Shortest time constant over the dwell: what is faster is averaged out within it."""


_RATIO = 2.0
"""Between time constants of the processes whose sum is the flicker."""


def flicker_of_means(gap: Array, duration: float, slowest: float) -> Array:
    """Covariance of means over ``duration`` s that are ``gap`` apart, for flicker with B = 1 and no slower than ``slowest`` s.

    A process of variance v and time constant τ has the one-sided density 4vτ/(1 + (2πfτ)²); processes whose τ are a ratio r
    apart sum up to v/(f·ln r), so that v = B²·ln r/π. The mean of such a process over T has the variance
    2v·(τ/T)·(1 − (τ/T)·(1 − e^(−T/τ))), and two means the covariance v·(τ/T)²·(1 − e^(−T/τ))²·e^(−(gap − T)/τ).
    """
    octaves = max(2, int(np.ceil(np.log(slowest / (_FASTEST * duration)) / np.log(_RATIO))) + 1)
    total = np.zeros(gap.shape)
    apart = gap > 0.5 * duration
    for tau in slowest * _RATIO ** -np.arange(octaves, dtype=np.float64):
        share = tau / duration
        fade = -np.expm1(-1.0 / share)
        own = 2.0 * share * (1.0 - share * fade)
        total += np.where(apart, (share * fade) ** 2 * np.exp(-np.maximum(gap - duration, 0.0) / tau), own)
    return total * np.log(_RATIO) / np.pi
