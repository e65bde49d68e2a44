"""Bias stability by its several definitions, warm-up time, and repeatability from turn-on to turn-on."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, norm

from inertial.arrays import Array
from inertial.dynamics.wander import (
    IdentifiedNoise,
    Posterior,
    dof_of_allan,
    dof_of_sd,
    kernels_of,
    line_of,
    remainders_of,
    stated_error,
    wander,
    wander_posterior,
)
from inertial.errors import NotIdentified
from inertial.noise.allan import overlapping

NOISE_MEANS = 40  # of a short record, for its flicker
MEAN_S, MOST_MEANS = 100.0, 144  # of the means of a stability; of those whose noise is told


@dataclass(frozen=True)
class StabilityFigures:
    """Stability of a bias record, in the record's unit; the definitions differ by up to thirty times for one unit.

    sd_100s, sd_100s_error : standard deviation of 100 s means, and its standard uncertainty for white noise, 1/f noise and walk
    sd_1s, range_1s, range_100s : standard deviation and range of 1 s means, range of 100 s means
    allan_100s, allan_100s_error : Allan deviation at 100 s
    drift_h, drift_h_error : slope per hour and its standard uncertainty for white and 1/f noise and random walk, which look like
        drift
    sd_100s_dof, allan_100s_dof : effective degrees of freedom
    sd_100s_interval, allan_100s_interval, drift_h_interval : ends (2,) of 95 % intervals: by χ² with the effective degrees of
        freedom of correlated means for the deviations, over the probable strengths of 1/f noise and walk for the drift
    """

    sd_100s: float
    sd_100s_error: float
    sd_1s: float
    range_1s: float
    range_100s: float
    allan_100s: float
    allan_100s_error: float
    drift_h: float
    drift_h_error: float
    sd_100s_interval: tuple[float, float]
    allan_100s_interval: tuple[float, float]
    drift_h_interval: tuple[float, float]
    sd_100s_dof: float
    allan_100s_dof: float


def block_means(record: Array, size: int) -> Array:
    """Means (m,) of ``size`` samples each."""
    count = len(record) // size
    return record[: count * size].reshape(count, size).mean(axis=1)


def error_of_mean(record: Array) -> Array:
    """Standard uncertainty of the mean of a record (n, 3), by axis (3,), from the scatter of the means of its ten parts."""
    means = np.array([part.mean(axis=0) for part in np.array_split(record, 10)])
    return np.asarray(means.std(axis=0, ddof=1) / np.sqrt(10.0))


def stability(record: Array, rate_hz: float, identified: IdentifiedNoise | None = None) -> StabilityFigures:
    """The figures of a bias record (n,).

    Parameters
    ----------
    identified : noise that the run's static record shows. An hour alone hardly tells a walk from 1/f noise, and a walk is
        a slope of any size

    Raises
    ------
    NotIdentified
        The record is shorter than ten means of 100 s.
    """
    hundred = block_means(record, round(MEAN_S * rate_hz))
    if hundred.size < 10:
        raise NotIdentified(f"stability: {hundred.size} means of 100 s, 10 or more are needed; record at least 1000 s")
    second = block_means(record, max(1, round(rate_hz)))
    time: Array = np.asarray(MEAN_S * np.arange(hundred.size) / 3600.0, dtype=np.float64)
    rows: Array = np.asarray(np.column_stack([np.ones_like(time), time - time.mean()]), dtype=np.float64)
    c = np.linalg.lstsq(rows, hundred, rcond=None)[0]
    noise = float(np.var(np.diff(second), ddof=1)) / 2.0 / MEAN_S  # white part of a mean of 100 s
    drift_error, mixtures = _drift_error(hundred, noise, identified)
    rate = rate_hz / max(1, round(rate_hz))
    curve = overlapping(second, rate, np.array([1, 3, 10, 30, round(MEAN_S * rate)]))
    allan, sd = float(curve.deviation[-1]), float(hundred.std(ddof=1))
    dof, allan_dof = (of(mixtures, noise, hundred.size) for of in (dof_of_sd, dof_of_allan))
    reach = float(norm.ppf(0.975)) * drift_error
    return StabilityFigures(
        sd_100s=sd,
        sd_100s_error=sd / float(np.sqrt(2.0 * dof)),
        sd_1s=float(second.std(ddof=1)),
        range_1s=float(np.ptp(second)),
        range_100s=float(np.ptp(hundred)),
        allan_100s=allan,
        allan_100s_error=allan / float(np.sqrt(2.0 * allan_dof)),
        drift_h=float(c[1]),
        drift_h_error=drift_error,
        sd_100s_interval=deviation_interval(sd, dof),
        allan_100s_interval=deviation_interval(allan, allan_dof),
        drift_h_interval=(float(c[1]) - reach, float(c[1]) + reach),
        sd_100s_dof=dof,
        allan_100s_dof=allan_dof,
    )


def _drift_error(means: Array, white: float, identified: IdentifiedNoise | None) -> tuple[float, Posterior]:
    """Standard uncertainty of the slope per hour of means of 100 s, and the probable mixtures of their noise."""
    size = -(-means.size // MOST_MEANS)  # a long record is told by fewer, longer means
    coarse, lasting = block_means(means, size), size * MEAN_S
    known = () if identified is None else identified.strengths(lasting)
    mixtures, of_line = (
        wander_posterior(remainders_of(coarse.size, terms), coarse, white / size, known) for terms in (1, 2)
    )
    weights = line_of(coarse.size)[:, 1] / (lasting / 3600.0)
    shares = [float(weights @ kernel @ weights) for kernel in kernels_of(coarse.size)]
    error = of_line.error_of(white / size * float(weights @ weights), *shares)
    return error, replace(mixtures, walk=mixtures.walk / size)


def dof_of_means(means: Array, white: float) -> float:
    """Effective degrees of freedom of the standard deviation of means of 100 s, each with white noise of a variance."""
    return dof_of_sd(_drift_error(means, white, None)[1], white, means.size)


def deviation_interval(deviation: float, dof: float) -> tuple[float, float]:
    """95 % interval of a standard deviation that is known with ``dof`` degrees of freedom: σ²·ν/χ²."""
    low, high = (deviation * float(np.sqrt(dof / chi2.ppf(p, dof))) for p in (0.975, 0.025))
    return low, high


@dataclass(frozen=True)
class ShortNoise:
    """Noise of a short record by Allan variances N²/τ + F².

    white : N², square of the record's unit times s
    flicker, flicker_error : F² and the standard deviation of its estimate
    """

    white: float
    flicker: float
    flicker_error: float


def short_noise(record: Array, rate_hz: float, *, trend: int = 0) -> ShortNoise:
    """White noise and flicker of a short record: white noise by its fastest differences, flicker by restricted likelihood.

    Two Allan variances at a thirtieth and a sixth of a record have five differences and know F² to 80 %; the likelihood of 40
    means uses all of them, and tells how well F² is known.

    Parameters
    ----------
    record : (n,)
    trend : order of the polynomial over time that is no noise
    """
    size = max(1, len(record) // NOISE_MEANS)
    means = block_means(record, size)
    if means.size < 4 + trend or float(np.ptp(record)) == 0.0:
        return ShortNoise(0.0, 0.0, 0.0)
    fast, slow = (float(np.mean(np.diff(block_means(record, k)) ** 2) / 2.0) for k in (1, min(4, size)))
    step = min(4, size)
    white = max(0.0, (fast - slow) / (1.0 - 1.0 / step)) if step > 1 else 0.0  # of a sample
    position = np.linspace(-1.0, 1.0, means.size)
    known = white / size * np.eye(means.size) + 1e-12 * float(np.var(means)) * np.eye(means.size)
    flicker = wander(np.vander(position, trend + 1), means, known, kernels_of(means.size)[0])
    octave = 2.0 * np.log(2.0)
    return ShortNoise(white / rate_hz, octave * flicker.variance, octave * flicker.error)


def difference_variance(window_s: float, apart_s: float = 0.0) -> float:
    """Variance of the difference of the means of two windows of w s, their middles d s apart, over F² of 1/f noise.

    It is 2h·(L(d) − ln w + 3/2), with the one-sided density h/f, h = F²/(2 ln 2), and L the mean of ln|t − t′| of both windows.
    Adjacent windows, which is what is assumed where no distance is given, have 2·F².
    """
    x = max(1.0, apart_s / window_s)
    outer, inner = (x + 1.0) ** 2 * np.log(x + 1.0), 0.0 if x <= 1.0 else (x - 1.0) ** 2 * np.log(x - 1.0)
    far = 0.5 * (outer + inner - 2.0 * x**2 * np.log(x))  # L(d) − ln w + 3/2
    return float(far / np.log(2.0))


def difference_error(noise: ShortNoise, window_s: float, apart_s: float = 0.0) -> float:
    """Standard uncertainty of the difference of the means of two windows, in white noise and flicker that is itself estimated."""
    slope = difference_variance(window_s, apart_s)
    return stated_error(2.0 * noise.white / window_s + noise.flicker * slope, slope, noise.flicker_error)


def settled_error(white: float, flicker: float, window_s: float, final_s: float, apart_s: float) -> float:
    """Standard uncertainty of a mean over a window minus that over a later part of the record, in white and 1/f noise.

    With a one-sided density h/f the variance is h·(3 + ln(d²/(w·T))) for means over w and T whose middles are d apart, and
    h = F²/(2 ln 2).

    Parameters
    ----------
    white, flicker : N² (per s) and F², as of :func:`white_and_flicker`
    window_s, final_s, apart_s : w, T and d, s
    """
    slow = max(flicker, 0.0) / (2.0 * np.log(2.0)) * max(0.0, 3.0 + np.log(apart_s**2 / (window_s * final_s)))
    return float(np.sqrt(max(white, 0.0) * (1.0 / window_s + 1.0 / final_s) + slow))


def warm_up_time(time: Array, record: Array, *, band: float, window_s: float) -> tuple[float, float]:
    """Time in s from power-on until the smoothed output stays within ± band of its final value; and that final value.

    The final value is the mean over the last fifth of the record. IEEE 528: within specification, and staying there.

    Parameters
    ----------
    time : (n,), s since power-on, evenly spaced
    record : (n,), any unit
    band : unit of the record
    window_s : of the moving mean, s

    Raises
    ------
    NotIdentified
        The output leaves the band in the last fifth of the record.
    """
    step = float(time[1] - time[0])
    size = max(1, round(window_s / step))
    sums = np.concatenate([[0.0], np.cumsum(record)])
    smooth = (sums[size:] - sums[:-size]) / size
    middle = time[: smooth.size] + 0.5 * (size - 1) * step
    final = float(record[int(0.8 * record.size) :].mean())
    outside = np.flatnonzero(np.abs(smooth - final) > band)
    if outside.size == 0:
        return float(time[0]), final
    last = float(middle[outside[-1]])
    if last > time[0] + 0.8 * float(np.ptp(time)):
        raise NotIdentified(
            f"warm-up: the output leaves ± {band:.3g} at {last:.0f} s, in the last fifth of the record; record longer"
        )
    return last + step, final


@dataclass(frozen=True)
class Repeatability:
    """Scatter of the bias from turn-on to turn-on, the cycles' own error removed.

    value : standard deviation between cycles; 0 where their own error explains all
    low, high : 95 % interval
    upper : one-sided 95 % upper limit
    """

    value: float
    low: float
    high: float
    upper: float
    cycles: int


def repeatability(means: Array, own_error: float) -> Repeatability:
    """Repeatability from the mean of every cycle (n,) and the standard uncertainty of one such mean within its cycle.

    s_b² = s² − s_w²; the interval is that of s by χ² with n − 1 degrees of freedom, reduced in the same way.
    """
    n = means.size
    if n < 3:
        raise NotIdentified(f"turn-on: {n} cycles, 3 or more are needed; add cycles")
    s2, dof = float(np.var(means, ddof=1)), n - 1

    def reduced(value: float) -> float:
        return float(np.sqrt(max(0.0, value - own_error**2)))

    low, high = (reduced(float(s2 * dof / chi2.ppf(p, dof))) for p in (0.975, 0.025))
    return Repeatability(reduced(s2), low, high, reduced(float(s2 * dof / chi2.ppf(0.05, dof))), n)
