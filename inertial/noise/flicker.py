"""The one kernel of 1/f wander: a sum of Ornstein–Uhlenbeck processes of equal variance, their time constants an octave apart.

A process of variance v and time constant τ has the one-sided density 4vτ/(1 + (2πfτ)²). Processes whose τ are a ratio r apart sum
up to v/(f·ln r) between the slowest and the fastest: with bias instability B, whose density is B²/(π·f), v = B²·ln r/π. Fit and
diagnosis look at the correlation, for which v is one over the number of processes; a plan starts from B.
"""

from collections.abc import Iterator

import numpy as np

from inertial.arrays import Array

FLICKER_FLOOR = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""sigma = 0.664·B on the flat part of the Allan curve: IEEE Std 952-1997, C.1.1.3."""

RATIO = 2.0
"""Between time constants."""

FASTEST_SPACING = 1.0 / 3.0
"""Fastest time constant of wander between dwells over their typical spacing: what is faster is white from dwell to dwell."""

FASTEST_WITHIN = 0.01
"""Fastest time constant of wander within dwells over their duration: what is faster is averaged out."""

SLOWEST_DIAGNOSED = 4.0
"""Slowest time constant over the length of the record where drifts are to be separated from wander."""

SLOWEST_FITTED = 1.0
"""The same where coefficients are fitted: what is slower than the record is, for the record, the bias itself."""


def time_constants(slowest: float, octaves: int) -> Array:
    """Time constants (octaves,), s, from the slowest down."""
    return slowest * RATIO ** -np.arange(octaves, dtype=np.float64)


def summed(gap: Array, constants: Array, duration: float = 0.0) -> Array:
    """Covariance of a sum of processes of variance one, at times ``gap`` apart or of means over dwells whose middles are.

    The mean over T has the variance 2·(τ/T)·(1 − (τ/T)·(1 − e^(−T/τ))), and two means the covariance
    (τ/T)²·(1 − e^(−T/τ))²·e^(−(gap − T)/τ).

    Parameters
    ----------
    gap : (...), s
    constants : (k,), s
    duration : s of each dwell; 0 for instants
    """
    total = np.zeros(gap.shape)
    if duration <= 0.0:
        for fade in _fading(gap, constants):
            total += fade
        return total
    # two means of one dwell are the same mean; between dwells, the fade between the end of one and the start of the other
    late, within = np.maximum(gap - duration, 0.0), 0.0
    for tau, fade in zip(constants, _fading(late, constants), strict=True):
        share = tau / duration
        inside = -np.expm1(-1.0 / share)
        within += 2.0 * share * (1.0 - share * inside)
        total += (share * inside) ** 2 * fade
    return np.where(gap > 0.5 * duration, total, within)


def _fading(gap: Array, constants: Array) -> Iterator[Array]:
    """e^(−gap/τ) (...), for each time constant in turn."""
    halving = constants.size > 1 and np.array_equal(constants[:-1], 2.0 * constants[1:])
    fade = np.exp(-gap / constants[0]) if constants.size else gap
    for index, tau in enumerate(constants):
        if index:  # of half the time constant it is the square
            fade = fade * fade if halving else np.exp(-gap / tau)
        yield fade


def flicker_kernel(time: Array, *, slowest: float = SLOWEST_DIAGNOSED) -> Array:
    """Correlation matrix (..., n, n) of 1/f wander at times ``time`` (..., n) in s.

    Time constants are those of :func:`constants_of`.
    """
    gap = np.abs(time[..., :, None] - time[..., None, :])
    constants = constants_of(time, slowest=slowest)
    return summed(gap, constants) / constants.size


def constants_of(time: Array, *, slowest: float) -> Array:
    """Time constants (k,), s, of wander between dwells, in octaves from a third of their spacing to ``slowest`` records.

    Parameters
    ----------
    time : (..., n), s
    """
    span = max(float(np.max(np.ptp(time, axis=-1))), 1.0) if time.size else 1.0
    spacing = max(float(np.median(np.diff(np.unique(time)))) if np.unique(time).size > 1 else 1.0, span / 1e5, 1e-6)
    octaves = max(int(np.ceil(np.log2(slowest * span / (spacing * FASTEST_SPACING)))), 2)
    return time_constants(slowest * span, octaves)


def flicker_of_means(gap: Array, duration: float, slowest: float) -> Array:
    """Covariance of means over ``duration`` s that are ``gap`` apart, for flicker with B = 1 and no slower than ``slowest`` s."""
    return summed(gap, constants_of_means(duration, slowest), duration) * np.log(RATIO) / np.pi


def constants_of_means(duration: float, slowest: float) -> Array:
    """Time constants (k,), s, of the processes behind means over ``duration`` s; each has the variance B²·ln 2/π."""
    return time_constants(
        slowest, max(2, int(np.ceil(np.log(slowest / (FASTEST_WITHIN * duration)) / np.log(RATIO))) + 1)
    )
