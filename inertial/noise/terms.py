"""Noise coefficients Q, N, B, K, R under an Allan curve, fitted together, each with an interval or an upper limit.

For a filter, a term that the curve does not identify has its likeliest strength. An upper limit instead of a value is right
where somebody asks how large a term may be. In a filter it is not: the limits of N, B and K cannot hold all at once, and the
limit of K from a record of half an hour is ten times the usual K, so that a filter stated five times the true deviation after an
hour without an update.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Index
from inertial.distributions import chi2_quantile, chi2_tail
from inertial.noise import mixture, profiles
from inertial.noise.allan import AllanCurve
from inertial.noise.covariance import Sums, sums
from inertial.noise.flicker import FLICKER_FLOOR

NAMES: Mapping[str, str] = {
    "Q": "quantisation",
    "N": "velocity random walk",
    "B": "bias instability",
    "K": "acceleration random walk",
    "R": "ramp",
}
UNITS: Mapping[str, str] = {
    "Q": "{}·s",
    "N": "{}/√Hz",
    "B": "{}",
    "K": "{}/√s",
    "R": "{}/s",
}
"""Unit of each coefficient for an output in {}; g/√Hz and g·√s are the same, K is often written g/s/√Hz."""


@dataclass(frozen=True)
class NoiseTerm:
    """One coefficient of one channel."""

    symbol: str
    name: str
    value: float | None
    """None: not identified, the data allow anything up to `high`."""
    low: float
    high: float
    unit: str
    """Pattern with {} for the output's unit."""

    @property
    def identified(self) -> bool:
        """Whether the curve needs this term."""
        return self.value is not None


@dataclass(frozen=True)
class NoiseTerms:
    """Coefficients of every channel of a curve (leading dimensions), the last axis in the order of `symbols`.

    N is the coefficient of IEEE Std 952 (two-sided density; sigma = N/√tau, a sample has N·√rate). Data sheets give the
    one-sided density N·√2.
    """

    symbols: tuple[str, ...]
    value: Array
    """(..., 5), NaN where not identified."""
    low: Array
    """(..., 5) lower end of the interval, 0 where not identified."""
    high: Array
    """(..., 5) upper end of the interval; the one-sided 95 % limit where not identified."""
    chi2: Array
    """(...,) of the curve about the fitted terms."""
    dof: Array
    """(...,)"""
    mixture: Array
    """(..., 5) coefficients of the likeliest mixture, which runs through the points whether or not its terms are identified."""
    bias_instability_bound: Array
    """(...,) min sigma / 0.664: an upper bound of B, reached only on a flat part: N and K alone report √(2.617·N·K)."""

    @property
    def p_value(self) -> Array:
        """Probability (...,) of a worse agreement if these terms were the whole truth."""
        return chi2_tail(self.chi2, self.dof)

    def one(self, *index: int) -> dict[str, NoiseTerm]:
        """Terms of one channel by symbol."""
        rows = zip(self.symbols, *(of[index].tolist() for of in (self.value, self.low, self.high)), strict=True)
        return {s: NoiseTerm(s, NAMES[s], None if np.isnan(v) else v, a, b, UNITS[s]) for s, v, a, b in rows}


CONFIDENCE = 0.95
"""Two-sided, of the intervals of terms."""


def fit_terms(curve: AllanCurve, only: str = "") -> NoiseTerms:
    """Coefficients of each channel of `curve` by generalised least squares on the log-variance.

    The covariance of the estimates at all averaging times is that of the fitted mixture itself. A term that the curve
    does not need is not identified and gets a limit: one whose removal costs less than chi-square 6.6, be it under the
    covariance of the fitted mixture or with that of what would stand in for it. Intervals are profiles with all other terms
    free, so a coefficient that another could replace has a wide one; an interval that reached zero would not be one of an
    identified term.

    Parameters
    ----------
    only : the one term whose interval is needed, to save the time of the others

    Raises
    ------
    ValueError
        A channel without any noise (constant output), or fewer averaging times than six.
    """
    count = len(mixture.TERMS)
    if curve.m.size <= count:
        raise ValueError(
            f"noise: {curve.m.size} averaging times, at least {count + 1} are needed for {count} terms; record longer"
        )
    if not np.all(curve.deviation > 0.0):
        where = np.argwhere(~(curve.deviation > 0.0))[0]
        raise ValueError(
            f"noise: channel {tuple(where[:-1].tolist())} has zero Allan deviation; a constant output says nothing"
        )
    moments = sums(curve.n, tuple(curve.m.tolist())).averaged(curve.records)
    variances = (curve.deviation**2).reshape(-1, curve.m.size)
    rows = [profiles.fit_terms(variance, moments, float(chi2_quantile(CONFIDENCE, 1)), only) for variance in variances]
    lead = curve.deviation.shape[:-1]
    rate = curve.rate_hz
    scale = np.sqrt(np.array([1.0 / rate**2, 1.0 / rate, 1.0, rate, rate**2]))  # per unit strength in samples

    def coefficients(strengths: list[Array]) -> Array:
        return np.sqrt(np.stack(strengths)).reshape(*lead, count) * scale

    return NoiseTerms(
        symbols=mixture.TERMS,
        value=coefficients([row.value for row in rows]),
        low=coefficients([row.low for row in rows]),
        high=coefficients([row.high for row in rows]),
        chi2=np.array([row.chi2 for row in rows]).reshape(lead),
        dof=np.array([row.dof for row in rows]).reshape(lead),
        mixture=coefficients([row.mixture for row in rows]),
        bias_instability_bound=np.min(curve.deviation, axis=-1) / FLICKER_FLOOR,
    )


def model_deviation(terms: NoiseTerms, tau: Array) -> Array:
    """Allan deviation (..., t) of the likeliest mixture at `tau` (t,) s: the line through the points of a plot."""
    q, n, b, k, r = np.moveaxis(terms.mixture, -1, 0)[..., None]
    flat = (FLICKER_FLOOR * b) ** 2
    return np.sqrt(3.0 * q**2 / tau**2 + n**2 / tau + flat + k**2 * tau / 3.0 + r**2 * tau**2 / 2.0)


_FREE = np.array([symbol not in {"K", "R"} for symbol in mixture.TERMS])
"""A filter knows no ramp: what looks like one is the end of a walk. The walk is searched."""
_SHARES = np.concatenate([[0.0], np.logspace(-4.0, 0.5, 19)])
"""Walks that are tried, as variances over that of the longest averaging times."""
_WORTH = 2.0  # fall of the deviance that one more parameter must bring (Akaike)
_SPREAD = 3.0  # n times the relative variance of the Allan variance of adjacent samples, for white noise
_LAST = 4  # averaging times that give the scale of a walk
_N, _B, _K = (mixture.TERMS.index(symbol) for symbol in ("N", "B", "K"))


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
        [_at(curve, moments, share * scale) for share in _SHARES]
        for curve, scale in zip(variance, walk_at_one, strict=True)
    ]
    deviances = np.sum([[deviance for deviance, _ in of_channel] for of_channel in fits], axis=0)
    best = int(np.argmin(deviances))
    best = best if deviances[0] - deviances[best] > _WORTH else 0
    strengths = np.stack([of_channel[best][1] for of_channel in fits])
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
