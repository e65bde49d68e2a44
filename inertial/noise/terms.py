"""Noise coefficients Q, N, B, K, R under an Allan curve, fitted together, each with an interval or an upper limit."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2

from inertial.noise import mixture
from inertial.noise.allan import AllanCurve
from inertial.noise.covariance import Sums, sums
from inertial.noise.mixture import MixtureFit

Array = NDArray[np.float64]

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

FLICKER_FLOOR = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""sigma = 0.664·B on the flat part of the curve: IEEE Std 952-1997, C.1.1.3."""

_KEPT_AT = 6.635
"""Chi-square (1 % for one term) that a term must be worth to be called identified."""
_ONE_SIDED_95 = 2.706
_NEGLIGIBLE = 1e-6
"""Share of the curve, as a variance, below which a term makes no difference."""
_WIDEST = 40.0  # natural logarithm: how far above a strength its upper limit is looked for
_RESOLUTION = 2e-3  # of an end of an interval, relative
_ROUNDS = 3  # of the covariance, which depends on the strengths


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

    def text(self, unit: str) -> str:
        """The coefficient in words, for an output in `unit`."""
        suffix = self.unit.format(unit)
        if self.value is None:
            return f"{self.symbol} not identified, ≤ {self.high:.3g} {suffix}"
        return f"{self.symbol} = {self.value:.4g} ({self.low:.3g} … {self.high:.3g}) {suffix}"


@dataclass(frozen=True)
class NoiseTerms:
    """Coefficients of every channel of a curve (leading dimensions), the last axis in the order of `symbols`.

    N is the coefficient of IEEE Std 952 (two-sided density; sigma = N/√tau, a sample has N·√rate). Data sheets give the
    one-sided density `density_one_sided` = N·√2.
    """

    symbols: tuple[str, ...]
    value: Array
    """(..., 5), NaN where not identified."""
    low: Array
    """(..., 5) lower end of the interval, 0 where not identified."""
    high: Array
    """(..., 5) upper end of the interval; the one-sided 95 % limit where not identified."""
    confidence: float
    chi2: Array
    """(...,) of the curve about the fitted terms."""
    dof: Array
    """(...,)"""
    bias_instability_bound: Array
    """(...,) min sigma / 0.664: an upper bound of B, reached only on a flat part: N and K alone report √(2.617·N·K)."""

    @property
    def density_one_sided(self) -> Array:
        """n_d = N·√2 (...,), the one-sided noise density of data sheets, output unit/√Hz; NaN where not identified."""
        return self.value[..., self.symbols.index("N")] * np.sqrt(2.0)

    @property
    def p_value(self) -> Array:
        """Probability (...,) of a worse agreement if these terms were the whole truth."""
        return np.asarray(chi2.sf(self.chi2, self.dof))

    def one(self, *index: int) -> dict[str, NoiseTerm]:
        """Terms of one channel by symbol."""
        where = tuple(index)
        rows = (self.value[where], self.low[where], self.high[where])
        return {
            s: NoiseTerm(
                s,
                NAMES[s],
                None if np.isnan(v) else float(v),
                float(a),
                float(b),
                UNITS[s],
            )
            for s, v, a, b in zip(self.symbols, *rows, strict=True)
        }


def fit_terms(curve: AllanCurve, *, confidence: float = 0.95) -> NoiseTerms:
    """Coefficients of each channel of `curve` by generalised least squares on the log-variance.

    The covariance of the estimates at all averaging times is that of the fitted mixture itself. A term that the curve
    does not need (its removal costs less than chi-square 6.6) is not identified and gets a limit. Intervals are profiles
    with all other terms free, so a coefficient that another could replace has a wide one.

    Parameters
    ----------
    curve : from `overlapping`
    confidence : two-sided, of the intervals

    Raises
    ------
    ValueError
        A channel without any noise (constant output), or fewer averaging times than six.
    """
    count = len(mixture.TERMS)
    if curve.m.size <= count:
        msg = f"noise: {curve.m.size} averaging times, at least {count + 1} are needed for {count} terms; record longer"
        raise ValueError(msg)
    if not np.all(curve.deviation > 0.0):
        where = np.argwhere(~(curve.deviation > 0.0))[0]
        msg = f"noise: channel {tuple(where[:-1].tolist())} has zero Allan deviation; a constant output says nothing"
        raise ValueError(msg)
    moments = sums(curve.n, tuple(curve.m.tolist()))
    variances = (curve.deviation**2).reshape(-1, curve.m.size)
    rows = [_one(variance, moments, float(chi2.ppf(confidence, 1))) for variance in variances]
    lead = curve.deviation.shape[:-1]
    scale = np.sqrt(_per_sample(curve.rate_hz))

    def coefficients(which: int) -> Array:
        return np.sqrt(np.stack([row[which] for row in rows])).reshape(*lead, count) * scale

    return NoiseTerms(
        symbols=mixture.TERMS,
        value=coefficients(0),
        low=coefficients(1),
        high=coefficients(2),
        confidence=confidence,
        chi2=np.array([row[3] for row in rows]).reshape(lead),
        dof=np.array([row[4] for row in rows]).reshape(lead),
        bias_instability_bound=np.min(curve.deviation, axis=-1) / FLICKER_FLOOR,
    )


def model_deviation(terms: NoiseTerms, tau: Array) -> Array:
    """Allan deviation (..., t) of the identified terms at `tau` (t,) s: the line through the points of a plot."""
    q, n, b, k, r = np.moveaxis(np.nan_to_num(terms.value), -1, 0)[..., None]
    flat = (FLICKER_FLOOR * b) ** 2
    return np.sqrt(3.0 * q**2 / tau**2 + n**2 / tau + flat + k**2 * tau / 3.0 + r**2 * tau**2 / 2.0)


def _per_sample(rate_hz: float) -> Array:
    """Squares of the coefficients Q, N, B, K, R per unit strength in samples."""
    return np.array([1.0 / rate_hz**2, 1.0 / rate_hz, 1.0, rate_hz, rate_hz**2])


def _one(variance: Array, moments: Sums, threshold: float) -> tuple[Array, Array, Array, float, float]:
    """Strengths (NaN where not needed), their ends, chi-square and degrees of freedom of one curve."""
    everything = np.ones(len(mixture.TERMS), dtype=np.bool_)
    task, strengths, best = _settled(variance, moments, everything, mixture.first_guess(variance, moments))
    kept, reduced, cost = _needed(task, strengths, best)
    low, high = np.zeros(kept.size), np.zeros(kept.size)
    for j in range(kept.size):
        if kept[j]:
            low[j], high[j] = _profile(task, strengths, best, j, threshold)
        else:
            high[j] = _profile(task, strengths, best, j, _ONE_SIDED_95)[1]
    value = np.where(kept, reduced, np.nan)
    low = np.fmin(low, np.where(kept, reduced, 0.0))
    return (
        value,
        low,
        np.fmax(high, np.nan_to_num(value)),
        cost,
        float(variance.size - int(kept.sum())),
    )


def _settled(variance: Array, moments: Sums, free: NDArray[np.bool_], start: Array) -> tuple[MixtureFit, Array, float]:
    """The problem whose covariance is that of its own solution, the solution and its chi-square."""
    strengths = start
    for _ in range(_ROUNDS):
        strengths, _ = mixture.problem(variance, moments, strengths).solve(free, strengths)
    task = mixture.problem(variance, moments, strengths)
    return task, *task.solve(free, strengths)


def _needed(task: MixtureFit, strengths: Array, best: float) -> tuple[NDArray[np.bool_], Array, float]:
    """Terms that stay after dropping, one by one, the one whose loss costs least, while that is little."""
    kept = strengths > 0.0
    current, cost = np.where(kept, strengths, 0.0), best
    while kept.sum() > 1:
        trials: list[tuple[float, int, Array]] = []
        for j in np.flatnonzero(kept).tolist():
            fewer = kept.copy()
            fewer[j] = False
            start = np.where(fewer, np.maximum(current, 1e-9 * current.max()), 0.0)
            fitted, worse = task.solve(fewer, start)
            trials.append((worse, j, fitted))
        worse, j, fitted = min(trials, key=lambda trial: trial[0])
        if worse - cost > _KEPT_AT:
            break
        kept[j], current, cost = False, fitted, worse
    return kept, current, cost


def _profile(task: MixtureFit, strengths: Array, best: float, j: int, threshold: float) -> tuple[float, float]:
    """Strengths of term j, below and above, at which chi-square has risen by `threshold`, all others free."""
    free = np.ones(strengths.size, dtype=np.bool_)
    free[j] = False
    whole_curve = float(np.exp(np.min(task.target - np.log(task.model[:, j]))))

    def excess(log_strength: float) -> float:
        start = strengths.copy()
        start[j] = np.exp(log_strength)
        return min(task.solve(free, start)[1] - best - threshold, 1e6)

    centre = float(np.log(max(strengths[j], _NEGLIGIBLE * whole_curve)))
    inside, outside = centre, centre + 0.5
    while excess(outside) < 0.0 and outside < centre + _WIDEST:
        inside, outside = outside, outside + 1.5
    high = _crossing(excess, inside, outside)
    bottom = centre + np.log(_NEGLIGIBLE)
    if strengths[j] <= 0.0 or excess(bottom) <= 0.0:
        return 0.0, high
    return _crossing(excess, bottom, centre), high


def _crossing(excess: Callable[[float], float], a: float, b: float) -> float:
    """Strength where `excess` of its logarithm changes sign; the nearer end where it does not."""
    at_a, at_b = excess(a), excess(b)
    if at_a * at_b > 0.0:
        return float(np.exp(a if abs(at_a) < abs(at_b) else b))
    return float(np.exp(cast("float", brentq(excess, a, b, xtol=_RESOLUTION))))
