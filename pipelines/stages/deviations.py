"""Further statistics of a static record: modified Allan, Hadamard, total and time deviation, TIE and MTIE.

Values and degrees of freedom are computed by allantools, except MTIE. The overlapping Allan deviation is in
:mod:`inertial.noise.allan`; see docs/decisions/statistics-of-records.md.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import allantools
import numpy as np
from allantools import ci
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from inertial.arrays import Array, Flags, Index
from inertial.distributions import chi2_quantile
from inertial.noise.allan import CONFIDENCE, AllanCurve
from inertial.noise.flicker import FLICKER_FLOOR
from inertial.noise.terms import NoiseTerms
from schemas.units import MICRO, STANDARD_GRAVITY_M_S2

POWER = {"Q": 2, "N": 0, "B": -1, "K": -2}
"""Exponent α of the power spectral density fᵅ of each noise term, which the degrees of freedom depend on; a ramp has none."""

TOTAL_BIAS = {0: 0.0, -1: 1.0 / (3.0 * np.log(2.0)), -2: 0.75}
"""Coefficient a by α: the expectation of the total variance is the Allan variance times 1 − a·τ/T, T the length of the record
(Greenhall, Howe and Percival, IEEE Trans. UFFC 46 (1999) 1183; NIST SP 1065, 5.2.11)."""

TABLED = 8
"""Smallest averaging time, in samples, for the table of degrees of freedom of the total variance: for white noise at one sample
the table gives 1.5·n, but the differences have n/1.5 (coverage of the interval 0.50 instead of 0.68)."""

M_S2 = {"g": STANDARD_GRAVITY_M_S2, "mg": STANDARD_GRAVITY_M_S2 / 1e3, "µg": STANDARD_GRAVITY_M_S2 / MICRO, "m/s²": 1.0}
"""Factor to m/s² by unit of the output, for outputs whose integral is a velocity in m/s."""


@dataclass(frozen=True)
class Statistic:
    """A statistic of a record of an output.

    Parameters
    ----------
    compute : function of a record (n,), a rate (Hz) and averaging times (t,), samples: deviations (t,), unit of the output, or of
        its integral if ``integral``
    parts : shortest record, in averaging times
    freedom : degrees of freedom of the variance for α, m and n samples; None: the statistic has no interval
    bias : expectation of the variance over the Allan variance, for α and m/n
    sees_ramp : whether a ramp of the output contributes to the deviation
    """

    name: str
    compute: Callable[[Array, float, Array], Array]
    parts: int = 3
    freedom: Callable[[int, int, int], float] | None = None
    bias: Callable[[int, float], float] = lambda *_: 1.0
    integral: bool = False
    sees_ramp: bool = True


@dataclass(frozen=True)
class Deviations:
    """A statistic of records (c, n): times (t,) s; deviation and ends of its interval (c, t), NaN where there is no interval."""

    tau: Array
    deviation: Array
    low: Array
    high: Array
    unit: str


def _of_allantools(name: str) -> Callable[[Array, float, Array], Array]:
    """The ``compute`` of a deviation of allantools, which returns values at exactly the given averaging times."""

    def compute(record: Array, rate_hz: float, m: Array) -> Array:
        return np.asarray(getattr(allantools, name)(record, rate=rate_hz, data_type="freq", taus=m / rate_hz)[1])

    return compute


def _mtie(record: Array, rate_hz: float, m: Array) -> Array:
    """MTIE (t,): largest range of the integral in any window of m steps; equal to the much slower allantools.mtie."""
    phase = np.concatenate([[0.0], np.cumsum(record - record.mean()) / rate_hz])
    out = np.empty(m.size)
    for i, size in enumerate(int(steps) + 1 for steps in m):
        inside = slice(size // 2, phase.size - (size - 1 - size // 2))
        out[i] = np.max(maximum_filter1d(phase, size)[inside] - minimum_filter1d(phase, size)[inside])
    return out


def _greenhall(order: int, *, modified: bool) -> Callable[[int, int, int], float]:
    return lambda alpha, m, n: ci.edf_greenhall(alpha, order, m, n + 1, overlapping=True, modified=modified)


def _total_freedom(alpha: int, m: int, n: int) -> float:
    """Degrees of freedom of the total variance, by those of the Allan variance for few samples; NaN if α is not tabulated."""
    if alpha not in TOTAL_BIAS:
        return np.nan
    return ci.edf_greenhall(alpha, 2, m, n + 1, overlapping=True) if m < TABLED else ci.edf_totdev(n, m, alpha)


STATISTICS = {
    "modified": Statistic("modified Allan deviation", _of_allantools("mdev"), 4, _greenhall(2, modified=True)),
    "hadamard": Statistic(
        "overlapping Hadamard deviation", _of_allantools("ohdev"), 4, _greenhall(3, modified=False), sees_ramp=False
    ),
    "total": Statistic(
        "total deviation",
        _of_allantools("totdev"),
        freedom=_total_freedom,
        bias=lambda alpha, share: 1.0 - TOTAL_BIAS.get(alpha, 0.0) * share,
    ),
    "time": Statistic("time deviation", _of_allantools("tdev"), 4, _greenhall(2, modified=True), integral=True),
    "tie": Statistic("RMS time interval error", _of_allantools("tierms"), integral=True),
    "mtie": Statistic("maximum time interval error", _mtie, integral=True),
}


def deviations(
    statistic: Statistic,
    records: Array,
    unit: str,
    curve: AllanCurve,
    terms: NoiseTerms,
    *,
    explained: Flags,
) -> Deviations:
    """A statistic of records, at those averaging times of their Allan curve for which the record is long enough.

    The intervals (68.27 %) use the degrees of freedom of the largest noise term at each averaging time. There is no interval
    where a ramp is largest, where no mixture of terms explains the curve, and where no degrees of freedom are known.

    Parameters
    ----------
    records : (c, n), in ``unit``; the mean is subtracted before integration
    curve, terms : Allan curve and noise terms of the same records
    explained : (c,), whether the terms explain the curve
    """
    m = curve.m[statistic.parts * curve.m <= curve.n]
    tau = m / curve.rate_hz
    raw = np.stack([statistic.compute(record, curve.rate_hz, m.astype(np.float64)) for record in records])
    relative = np.stack(
        [
            _interval(statistic, _largest(terms.mixture[k], tau, statistic), m, curve.n)
            if explained[k]
            else np.full((2, m.size), np.nan)
            for k in range(len(records))
        ]
    )
    factor = M_S2.get(unit, 1.0) if statistic.integral else 1.0
    unit = (
        ("m/s" if unit in M_S2 else f"{unit or 'unit'}·s") if statistic.integral else unit
    )  # of an integral over time
    value = factor * raw
    return Deviations(tau, value, value * relative[:, 0], value * relative[:, 1], unit)


def _largest(mixture: Array, tau: Array, statistic: Statistic) -> list[int | None]:
    """Exponent α of the term with the largest share of the Allan variance at each averaging time; None for a ramp."""
    q, n, b, k, r = mixture[:, None]
    ramp = r**2 * tau**2 / 2.0 if statistic.sees_ramp else np.zeros_like(tau)
    shares = np.stack(
        [3.0 * q**2 / tau**2, n**2 / tau, np.broadcast_to((FLICKER_FLOOR * b) ** 2, tau.shape), k**2 * tau / 3.0, ramp]
    )
    powers = [*POWER.values(), None]
    return [powers[largest] for largest in np.argmax(shares, axis=0)]


def _interval(statistic: Statistic, powers: list[int | None], m: Index, n: int) -> Array:
    """Lower and upper end of the interval, (2, t), relative to the deviation; NaN without an interval."""
    rows = [
        (np.nan, 1.0) if alpha is None else (_freedom(statistic, alpha, int(k), n), statistic.bias(alpha, int(k) / n))
        for alpha, k in zip(powers, m, strict=True)
    ]
    freedom, bias = np.array(rows).T
    tail = 0.5 * (1.0 - CONFIDENCE)
    known = np.isfinite(freedom)
    out = np.full((2, m.size), np.nan)
    for row, p in zip(out, (1.0 - tail, tail), strict=True):
        row[known] = np.sqrt(freedom[known] / (bias[known] * chi2_quantile(p, freedom[known])))
    return out


@lru_cache(maxsize=512)
def _freedom(statistic: Statistic, alpha: int, m: int, n: int) -> float:
    """Degrees of freedom; NaN where no formula is available."""
    if statistic.freedom is None:
        return np.nan
    try:
        return float(statistic.freedom(alpha, m, n))
    except NotImplementedError:
        # white noise of the integral, and few windows: allantools lacks that formula of Greenhall and Riley
        return np.nan
