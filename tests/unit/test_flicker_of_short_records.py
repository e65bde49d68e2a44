"""Flicker that is known from a short record only: its estimate, and what it costs a difference of means and a warm-up time."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import binom, chi2

from inertial.dynamics.centrifuge import TERMS, Polynomial, fit_polynomial, linearity_error, linearity_percent
from inertial.dynamics.stability import ShortNoise, difference_error, difference_variance, short_noise
from inertial.dynamics.wander import logarithmic_kernel, stated_error, variance_of_sum
from inertial.dynamics.warm_up import entered
from inertial.errors import NotIdentified

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


def test_the_difference_of_two_short_windows_is_held_by_its_uncertainty(rng: np.random.Generator) -> None:
    runs = 400
    record = flicker(rng, runs, 240)
    pulls, sizes = [], []
    for own in record:
        noise = [short_noise(part, 1.0) for part in (own[:40], own[200:])]
        pooled = ShortNoise(
            float(np.mean([one.white for one in noise])),
            float(np.mean([one.flicker for one in noise])),
            float(np.hypot(noise[0].flicker_error, noise[1].flicker_error) / 2.0),
        )
        sizes.append(pooled.flicker / OCTAVE)
        pulls.append((own[200:].mean() - own[:40].mean()) / difference_error(pooled, 40.0, 200.0))
    assert np.mean(sizes) == pytest.approx(1.0, abs=2.6 * np.std(sizes) / np.sqrt(runs))
    assert spread_of_one(pulls)
    assert share_of_95(np.abs(pulls) < 1.96)


def test_a_warm_up_in_noise_is_neither_late_nor_more_certain_than_it_is(rng: np.random.Generator) -> None:
    time = np.asarray(np.arange(1200) + 0.5, dtype=np.float64)
    clean, true = 1e4 * np.exp(-time / 120.0), 120.0 * np.log(10.0)
    runs = 300
    for size in (
        10.0,
        30.0,
        80.0,
    ):  # 80 is a sixth of the band in the level: there the pulls are skew, the interval is not
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


def test_the_uncertainty_of_the_linearity_holds_the_covariance(rng: np.random.Generator) -> None:
    steps = np.array([1.0, 3.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
    force = np.concatenate([steps, -steps])
    error = np.full(force.size, 1e-4)
    curve = force + 2e-6 * force**2 + 1e-7 * force**3
    fits = [fit_polynomial(force, curve + error * rng.normal(size=force.size), error, TERMS) for _ in range(120)]
    spread = np.std([linearity_percent(one, 30.0) for one in fits], ddof=1)
    assert np.mean([linearity_error(one, 30.0) for one in fits]) == pytest.approx(spread, rel=0.2)
    one = fits[0]
    apart = Polynomial(one.names, one.value, np.diag(np.diag(one.covariance)), one.residuals, 0.0, 0)
    assert linearity_error(apart, 30.0) > 2.0 * spread
