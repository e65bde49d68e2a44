"""Overlapping Allan deviation with honest intervals."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import Array, Index
from inertial.distributions import chi2_quantile
from inertial.noise import mixture

Spacing = Literal["octave", "decade"] | Sequence[int] | Index

FEWEST_SAMPLES = 8
CONFIDENCE = 0.6827
"""Two-sided, of the intervals of a curve."""


@dataclass(frozen=True)
class AllanCurve:
    """Allan deviation over averaging time, for one channel or many (leading dimensions)."""

    tau: Array
    """(t,) averaging times, s."""
    deviation: Array
    """(..., t) overlapping Allan deviation, unit of the output."""
    edf: Array
    """(..., t) equivalent degrees of freedom of each variance."""
    low: Array
    """(..., t) lower end of the interval, unit of the output."""
    high: Array
    """(..., t) upper end of the interval, unit of the output."""
    n: int
    """Samples of the record."""
    rate_hz: float
    """Sampling rate, Hz."""
    m: Index
    """(t,) averaging times in samples."""
    records: int = 1
    """Independent records of n samples whose variances were averaged."""


def overlapping(x: ArrayLike, rate_hz: float, m: Spacing | None = None) -> AllanCurve:
    """Overlapping Allan deviation of records of an output (not of its integral), with chi-square intervals.

    sigma^2(tau) = mean (x[k+2m] - 2 x[k+m] + x[k])^2 / (2 tau^2) with x the running integral: NIST SP 1065, eq. 11. The
    degrees of freedom come from the exact sampling variance under the mixture of quantisation, white, flicker, random
    walk and ramp that fits the curve (`covariance`), not from the number of averages, which claims far too much.

    Parameters
    ----------
    x : (..., n), unit of the output
    rate_hz : Hz
    m : averaging times in samples, or "octave" (default: 1, 2, 4 …) or "decade" (1, 2, 5, 10 …); both to a third of n

    Raises
    ------
    ValueError
        Fewer samples than 8, a value that is not finite, a spacing outside 1..(n-1)/2.
    """
    spacings, variance = variances(x, rate_hz, m)
    return curve_of(variance, spacings, np.asarray(x).shape[-1], rate_hz)


def variances(x: ArrayLike, rate_hz: float, m: Spacing | None = None) -> tuple[Index, Array]:
    """Averaging times (t,) in samples and Allan variances (..., t) of records, as in :func:`overlapping`."""
    data = np.asarray(x, dtype=np.float64)
    spacings = _spacings(_checked(data, rate_hz), m)
    return spacings, _variances(data, spacings)


def curve_of(variance: Array, m: Index, n: int, rate_hz: float, records: int = 1) -> AllanCurve:
    """The curve of Allan variances (..., t), each the mean of that of several independent records of ``n`` samples."""
    edf = mixture.degrees_of_freedom(variance, m, n, records)
    tail = 0.5 * (1.0 - CONFIDENCE)
    return AllanCurve(
        tau=m / rate_hz,
        deviation=np.sqrt(variance),
        edf=edf,
        low=np.sqrt(variance * edf / chi2_quantile(1.0 - tail, edf)),
        high=np.sqrt(variance * edf / chi2_quantile(tail, edf)),
        n=n,
        rate_hz=rate_hz,
        m=m,
        records=records,
    )


def octaves(n: int) -> Index:
    """Averaging times 1, 2, 4, … samples up to a third of `n`."""
    return 2 ** np.arange(int(np.log2(max(n // 3, 1))) + 1, dtype=np.int64)


def decades(n: int) -> Index:
    """Averaging times 1, 2, 5, 10, 20, … samples up to a third of `n`."""
    powers = 10 ** np.arange(int(np.log10(n)) + 1, dtype=np.int64)
    times = np.outer(powers, np.array([1, 2, 5], dtype=np.int64)).ravel()
    return times[times <= n // 3]


def _checked(data: Array, rate_hz: float) -> int:
    n = data.shape[-1] if data.ndim else 0
    if n < FEWEST_SAMPLES:
        raise ValueError(f"allan: record of {n} samples, at least {FEWEST_SAMPLES} are needed; record longer")
    if not np.isfinite(rate_hz) or rate_hz <= 0.0:
        raise ValueError(f"allan: sampling rate {rate_hz} Hz, a positive rate is needed; give the rate of the record")
    bad = np.argwhere(~np.isfinite(data))
    if bad.size:
        raise ValueError(
            f"allan: sample {int(bad[0][-1])} is {data[tuple(bad[0])]}, finite values are needed; remove the gap first"
        )
    return n


def _spacings(n: int, m: Spacing | None) -> Index:
    if m is None or (isinstance(m, str) and m == "octave"):
        return octaves(n)
    if isinstance(m, str):
        return decades(n)
    spacings = np.unique(np.asarray(m, dtype=np.int64))
    if spacings.size == 0 or spacings[0] < 1 or 2 * spacings[-1] > n - 1:
        raise ValueError(
            f"allan: averaging times {spacings.tolist()} samples, 1 to {(n - 1) // 2} are possible with {n} samples"
        )
    return spacings


def _variances(data: Array, spacings: Index) -> Array:
    """Allan variances (..., t). The mean is taken out first: it does not count, and sums of raw counts lose digits."""
    n = data.shape[-1]
    phase = np.zeros((*data.shape[:-1], n + 1))
    np.cumsum(data - data.mean(axis=-1, keepdims=True), axis=-1, out=phase[..., 1:])
    out = np.empty((*data.shape[:-1], spacings.size))
    for i, m in enumerate(spacings.tolist()):
        second = phase[..., 2 * m :] - 2.0 * phase[..., m:-m] + phase[..., : -2 * m]
        out[..., i] = np.einsum("...k,...k->...", second, second) / (2.0 * m * m * second.shape[-1])
    return out
