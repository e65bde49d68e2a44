"""Likeliest N, B and K of an Allan curve, for a filter: a term that the curve does not identify has its likeliest strength.

An upper limit in place of a value is right where somebody asks how large a term may be. In a filter it is not: the limits of
N, B and K cannot hold all at once, and the limit of K from a record of half an hour is ten times the usual K, so that a filter
stated five times the true deviation after an hour without an update.
"""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Index
from inertial.noise import mixture
from inertial.noise.covariance import Sums, sums

SYMBOLS = ("N", "B", "K")
_FREE = np.array([symbol not in {"K", "R"} for symbol in mixture.TERMS])
"""A filter knows no ramp: what looks like one is the end of a walk. The walk is searched."""
_SHARES = np.concatenate([[0.0], np.logspace(-4.0, 0.5, 19)])
"""Walks that are tried, as variances over that of the longest averaging times."""
_WORTH = 2.0  # fall of the deviance that one more parameter must bring (Akaike)
_SPREAD = 3.0  # n times the relative variance of the Allan variance of adjacent samples, for white noise
_LAST = 4  # averaging times that give the scale of a walk
_N, _B, _K = (mixture.TERMS.index(symbol) for symbol in SYMBOLS)


@dataclass(frozen=True)
class LikelyTerms:
    """N, B and K of the channels of a unit, in the unit of the output: (c,) each."""

    white: Array
    instability: Array
    walk: Array


def likely_terms(deviation: Array, m: Index, n: int, rate_hz: float) -> LikelyTerms:
    """The likeliest mixture of Q, N, B and K of every channel, with one walk for all of them.

    The walk of a record is the least known term: alone, the likeliest one of a channel is zero in half of the cases and several
    times the true one in others. So the channels of a unit share it, as the share of a walk in the variance at the longest
    averaging times, at which the likelihood of all of them together is largest.

    Parameters
    ----------
    deviation : (c, t), Allan deviation of the channels of a unit, at ``m`` (t,) samples, of ``n`` at ``rate_hz``
    """
    moments = sums(n, tuple(m.tolist()))
    variance = np.asarray(deviation, dtype=np.float64) ** 2
    walk_at_one = np.exp(np.mean(np.log(variance[:, -_LAST:]), axis=1)) * 3.0 / float(m[-1])
    fits = [
        [_at(one, moments, share * scale) for share in _SHARES]
        for one, scale in zip(variance, walk_at_one, strict=True)
    ]
    deviances = np.sum([[deviance for deviance, _ in own] for own in fits], axis=0)
    best = int(np.argmin(deviances))
    best = best if deviances[0] - deviances[best] > _WORTH else 0
    strengths = np.stack([own[best][1] for own in fits])
    # what the curve cannot tell from no white noise: one standard deviation of its first point
    white = np.maximum(strengths[:, _N], variance[:, 0] * np.sqrt(_SPREAD / n))
    return LikelyTerms(np.sqrt(white / rate_hz), np.sqrt(strengths[:, _B]), np.sqrt(strengths[:, _K] * rate_hz))


def _at(variance: Array, moments: Sums, walk: float) -> tuple[float, Array]:
    """Deviance of one curve (t,) with a given walk, and the likeliest strengths (5,) of the others, per sample."""
    start = np.where(_FREE, mixture.first_guess(variance, moments), 0.0)
    if not np.any(start > 0.0):
        start = np.where(np.arange(start.size) == _B, variance.min(), 0.0)
    start[_K] = walk
    return mixture.deviance(variance, moments, _FREE, start)
