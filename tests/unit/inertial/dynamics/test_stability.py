"""Intervals of the stability of an hour, and flicker that is known from a short record only."""

import independent_noise as made
import numpy as np
import pytest
from long_suites import mostly_slow
from scipy.integrate import quad
from scipy.stats import binom, chi2

from inertial.dynamics.stability import (
    ShortNoise,
    deviation_interval,
    difference_error,
    difference_variance,
    short_noise,
    stability,
)
from inertial.dynamics.wander import IdentifiedNoise, logarithmic_kernel, stated_error, variance_of_sum
from inertial.dynamics.warm_up import entered
from inertial.errors import NotIdentified
from pipelines.stages.noise import bias_stability

AT = np.arange(36)
WALK = 100.0 * (np.minimum.outer(AT, AT) + np.where(np.equal.outer(AT, AT), 1 / 3, 0.5))
"""Covariance of 36 means of 100 s of a walk of one unit per √s."""


@pytest.mark.parametrize("walk", mostly_slow([0.0, 1.0], 1.0))
def test_the_stability_of_the_static_record_has_the_freedoms_of_its_noise(walk, rng):
    held, runs = 0, 200
    covariance = np.eye(36) + walk**2 * WALK
    true = float(np.sqrt((np.trace(covariance) - covariance.mean() * 36.0) / 35.0))
    for _ in range(runs):
        found = bias_stability(10.0 * rng.normal(size=3600) + walk * np.cumsum(rng.normal(size=3600)), 1.0)
        held += found[1] <= true <= found[2]
    assert held / runs > 0.9  # as of 36 independent means it holds in 42 % of a walk


SECONDS, RUNS = 3600, 100


def hours(rng: np.random.Generator, white: float, flicker: float) -> tuple[np.ndarray, np.ndarray]:
    """Means of 1 s over an hour (RUNS, 3600) of white noise and of 1/f noise of density ``flicker``²/f, and its densities.

    The 1/f noise ends at a period of 2¹⁶ s, eighteen hours, of which an hour is cut out.
    """
    f = np.arange(1, 2**15 + 1) / 2**16
    slow = np.stack([made.flicker(rng, 1, SECONDS, flicker * np.sqrt(np.pi), longer=16)[0] for _ in range(RUNS)])
    return slow + white * rng.normal(size=slow.shape), flicker**2 / f


def expected(white: float, density: np.ndarray, walk: float) -> tuple[float, float]:
    """Roots of the expected variance of 36 means of 100 s, and of the Allan variance at 100 s."""
    f = np.arange(1, density.size + 1) / (2.0 * density.size)
    mean = np.array([np.sin(100.0 * np.pi * x) / (100.0 * np.sin(np.pi * x)) for x in f]) ** 2
    lag = np.array([np.sum(density * mean * np.cos(200.0 * np.pi * f * j)) for j in range(36)]) * f[0]
    covariance = lag[np.abs(np.subtract.outer(np.arange(36), np.arange(36)))] + np.eye(36) * white**2 / 100.0
    covariance = covariance + walk**2 * WALK
    spread = np.trace(covariance) / 36.0 - np.mean(covariance)
    allan = lag[0] - lag[1] + white**2 / 100.0 + 100.0 / 3.0 * walk**2
    return float(np.sqrt(36.0 / 35.0 * spread)), float(np.sqrt(allan))


NOISES = [(10.0, 0.0, 0.0), (10.0, 5.0, 0.0), (3.0, 50.0, 0.0), (10.0, 5.0, 1.0), (10.0, 0.0, 5.0)]


@pytest.mark.parametrize(("white", "flicker", "walk"), mostly_slow(NOISES, (10.0, 5.0, 1.0)))
@pytest.mark.parametrize("shown", ["by the hour alone", "by a static record"])
def test_the_intervals_of_an_hour_hold_the_process(white, flicker, walk, shown, rng):
    records, density = hours(rng, white, flicker)
    records = records + walk * np.cumsum(rng.normal(size=records.shape), axis=1)
    sd, allan = expected(white, density, walk)
    # as a static record has them, to a quarter; what is not there has a limit
    sizes = (flicker * np.sqrt(np.pi), walk)
    known = [(size, 0.7 * size, 1.4 * size) if size else (np.nan, 0.0, 0.02) for size in sizes]
    identified = IdentifiedNoise(*known) if shown == "by a static record" else None
    stabilities = [stability(one, 1.0, identified) for one in records]
    for name, true in (("sd_100s", sd), ("allan_100s", allan), ("drift_h", 0.0)):
        ends = np.array([getattr(one, f"{name}_interval") for one in stabilities])
        held = int(np.sum((ends[:, 0] <= true) & (true <= ends[:, 1])))
        # of a walk, whose variance is told by few turns, χ² is an approximation
        assert held >= binom.ppf(0.005, RUNS, 0.92 if walk else 0.94), (name, held)
    # an interval of a deviation is longer above; that of independent means has 35 degrees of freedom
    one = stabilities[0]
    assert one.sd_100s_interval[1] - one.sd_100s > one.sd_100s - one.sd_100s_interval[0]
    told = np.mean([abs(one.drift_h) > 2.0 * one.drift_h_error for one in stabilities])
    assert told <= 0.12  # no unit drifts: a walk had been taken for a drift in half of them
    if flicker == walk == 0.0:
        dof = np.median([0.5 * (one.sd_100s / one.sd_100s_error) ** 2 for one in stabilities])
        assert 25.0 < dof < 36.0  # 36 means do not exclude wander of the size of the white noise


def test_the_interval_of_a_deviation_is_that_of_chi_square() -> None:
    low, high = deviation_interval(2.0, 9.0)
    assert (low, high) == pytest.approx((2.0 * 0.6878, 2.0 * 1.8256), rel=1e-3)  # table of the facts: n = 10


OCTAVE = 2.0 * np.log(2.0)


def flicker(rng: np.random.Generator, runs: int, count: int) -> np.ndarray:
    """Means of 1/f noise with the one-sided density 1/f, (runs, count), by the spectrum of a record eight times as long."""
    long = 8 * count
    f = np.arange(1, long // 2 + 1) / long
    z = rng.normal(size=(runs, f.size)) + 1j * rng.normal(size=(runs, f.size))
    density = 1.0 / f * np.sinc(f) ** 2
    # what lies above half the rate folds down in the means
    for k in range(1, 6):
        for g in (k - f, k + f):
            density = density + np.sinc(g) ** 2 / g
    spectrum = np.concatenate([np.zeros((runs, 1)), z * np.sqrt(0.5 * density / long)], axis=1)
    spectrum[:, -1] = spectrum[:, -1].real * np.sqrt(2.0)
    return np.fft.irfft(spectrum * long / np.sqrt(2.0), long)[:, :count]


def spread_of_one(pulls: list[float]) -> bool:
    """Whether the standard deviation lies in the 99 % interval of that of so many normal numbers."""
    low, high = chi2.ppf([0.005, 0.995], len(pulls) - 1) / (len(pulls) - 1)
    return bool(low < np.var(pulls, ddof=1) < high)


def share_of_95(held: list[bool] | np.ndarray) -> bool:
    """Whether as many hold as of so many 95 % intervals with a probability of 99 %."""
    return bool(binom.ppf(0.005, len(held), 0.95) <= np.sum(held) <= binom.ppf(0.995, len(held), 0.95))


def test_the_kernel_is_the_mean_of_the_logarithm_over_both_windows() -> None:
    kernel = logarithmic_kernel(5)
    for k in range(5):  # by quadrature over the difference t − t′, whose density is a triangle
        parts = [quad(lambda s, k=k: -(1.0 - abs(s)) * np.log(abs(k + s)), a, b)[0] for a, b in ((-1, 0), (0, 1))]
        assert kernel[k] == pytest.approx(sum(parts), abs=1e-8)
    weights = np.array([1.0, 0.0, 0.0, -1.0])
    assert variance_of_sum(weights) == pytest.approx(2.0 * (kernel[0] - kernel[3]))
    assert variance_of_sum(weights) / OCTAVE == pytest.approx(difference_variance(1.0, 3.0))
    assert difference_variance(1.0) == pytest.approx(2.0)  # Allan: adjacent windows differ by 2·F²


def test_few_data_widen_the_uncertainty_by_students_t() -> None:
    assert stated_error(4.0, 1.0, 0.0) == pytest.approx(2.0)
    # a variance that is all an estimate of 5 degrees of freedom: t(0.975, 5) = 2.571
    assert stated_error(1.0, 1.0, np.sqrt(2.0 / 5.0)) == pytest.approx(2.5706 / 1.95996, rel=1e-4)
    assert stated_error(1.0, 0.0, 1.0) == pytest.approx(1.0)
    assert stated_error(0.0, 1.0, 1.0) == 0.0
    # a factor of √V known to 1/√(2ν) is as much as a variance of ν degrees of freedom
    assert stated_error(1.0, 0.0, 0.0, np.sqrt(1.0 / 10.0)) == pytest.approx(2.5706 / 1.95996, rel=1e-4)


@pytest.mark.slow
def test_the_difference_of_two_short_windows_is_held_by_its_uncertainty(rng: np.random.Generator) -> None:
    runs = 400
    record = flicker(rng, runs, 240)
    pulls, sizes = [], []
    for own in record:
        noise = [short_noise(part, 1.0) for part in (own[:40], own[200:])]
        white, slow = (float(np.mean([getattr(one, name) for one in noise])) for name in ("white", "flicker"))
        pooled = ShortNoise(white, slow, float(np.hypot(*(one.flicker_error for one in noise)) / 2.0))
        sizes.append(pooled.flicker / OCTAVE)
        pulls.append((own[200:].mean() - own[:40].mean()) / difference_error(pooled, 40.0, 200.0))
    assert np.mean(sizes) == pytest.approx(1.0, abs=2.6 * np.std(sizes) / np.sqrt(runs))
    assert spread_of_one(pulls)
    assert share_of_95(np.abs(pulls) < 1.96)


@pytest.mark.parametrize("size", mostly_slow([10.0, 30.0, 80.0], 30.0))
def test_a_warm_up_in_noise_is_neither_late_nor_more_certain_than_it_is(size: float, rng: np.random.Generator) -> None:
    time = np.asarray(np.arange(1200) + 0.5, dtype=np.float64)
    clean, true = 1e4 * np.exp(-time / 120.0), 120.0 * np.log(10.0)
    runs = 300
    # 80 is a sixth of the band in the level: there the pulls are skew, the interval is not
    pulls, held, refused = [], [], 0
    for own in flicker(rng, runs, 1200):
        try:
            entry = entered(time, clean + size * own, band=1000.0, window_s=10.0)
        except NotIdentified:
            refused += 1
            continue
        pulls.append((entry.value - true) / entry.error)
        held.append(entry.low <= true <= entry.high)
    assert refused <= (0.02 * runs if size > 50.0 else 0.0)  # an entry that noise leaves open
    assert size > 50.0 or (abs(np.mean(pulls)) < 2.6 / np.sqrt(runs) and spread_of_one(pulls))
    assert share_of_95(held)
    exact = entered(time, clean + 1e-3 * flicker(rng, 1, 1200)[0], band=1000.0, window_s=10.0)
    assert exact.value == pytest.approx(true, abs=0.6)
    with pytest.raises(NotIdentified):
        entered(time[:300], clean[:300], band=10.0, window_s=10.0)
