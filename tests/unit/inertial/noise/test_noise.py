"""Small modules of the noise: spectrum, dwell means, measurands of a bias, Gauss-Markov processes, errors of navigation."""

import made_noise as generate
import numpy as np
import pytest
from scipy import signal
from scipy.integrate import dblquad

from inertial.noise.allan import overlapping
from inertial.noise.dwells import DwellNoise, dwell_covariance, whitener
from inertial.noise.gauss_markov import (
    AT_MAXIMUM,
    FLICKER_VARIANCE,
    allan_variance,
    flicker_terms,
    step_of_process,
    step_of_walk,
)
from inertial.noise.measurands import walk_kernel
from inertial.noise.navigation import PER_G, navigation_error
from inertial.noise.psd import allan_variance as variance_of_spectrum
from inertial.noise.psd import one_sided


def test_spectrum_and_allan_variance_say_the_same() -> None:
    rng = np.random.default_rng(10)
    x = generate.white(rng, (16, 2**16), 1.0, 1.0) + generate.flicker(rng, (16, 2**16), 1.0)
    spectrum = one_sided(x, 1.0, segment=2**13)
    curve = overlapping(x, 1.0, np.array([16, 64, 128]))
    expected = variance_of_spectrum(spectrum.frequency, spectrum.density.mean(axis=0), curve.tau)
    np.testing.assert_allclose(np.mean(curve.deviation**2, axis=0), expected, rtol=0.05)


@pytest.mark.parametrize(("count", "segment"), [(1000, 125), (1001, 124), (64, 64), (500, 333)])
def test_the_spectrum_is_that_of_scipy_signal(count: int, segment: int) -> None:
    x = np.random.default_rng(61).normal(3.0, 2.0, (2, count))
    frequency, density = signal.welch(x, fs=50.0, nperseg=segment, detrend="constant")
    spectrum = one_sided(x, 50.0, segment=segment)
    np.testing.assert_allclose(spectrum.frequency, frequency, rtol=1e-12)
    np.testing.assert_allclose(spectrum.density, density, rtol=1e-9, atol=1e-14)


def test_a_walk_has_its_closed_forms_a_whitener_makes_white_and_dwells_end_where_wander_begins():
    noise, time = DwellNoise(0.0, 0.0, 2e-6), np.array([110.0, 310.0])
    assert noise.error(12.0) == pytest.approx(2e-6 * np.sqrt(12.0 / 3.0))
    expected = 4e-12 * np.array([[100.0 - 2.0, 100.0], [100.0, 300.0 - 2.0]])  # a mean loses a sixth of its length
    assert dwell_covariance(time, 12.0, noise, since=10.0) == pytest.approx(expected)
    time = np.array([0.0, 20.0, 40.0, 900.0, 920.0]) + 1000.0
    covariance = dwell_covariance(time, 10.0, DwellNoise(1e-5, 1e-4, 1e-6))
    white = whitener(covariance)
    assert white @ covariance @ white.T == pytest.approx(np.eye(5), abs=1e-9)
    flicker = DwellNoise(1e-5, 1e-5)
    assert flicker.white(flicker.balanced()) == pytest.approx(flicker.wander(flicker.balanced()))
    assert DwellNoise(1e-5).balanced() == float("inf")


def test_a_walk_about_its_mean_is_a_walk_less_the_integral_over_its_record() -> None:
    fine = np.linspace(0.0, 90.0, 1801)
    whole = np.minimum.outer(fine, fine) / 90.0
    at = np.array([0, 140, 400, 820, 1800])
    weight = np.full(fine.size, 1.0 / (fine.size - 1))
    weight[[0, -1]] *= 0.5
    with_mean = whole @ weight
    expected = whole[np.ix_(at, at)] - with_mean[at] - with_mean[at][:, None] + weight @ with_mean
    np.testing.assert_allclose(walk_kernel(fine[at] + 1e4), expected, atol=1e-6)


def test_it_is_counted_from_the_mean_of_the_dwells_that_are_fitted() -> None:
    time = np.array([0.0, 10.0, 20.0, 30.0, 80.0, 90.0])
    fitted = time < 50.0
    inner = walk_kernel(time[fitted])
    np.testing.assert_allclose(walk_kernel(time, fitted)[np.ix_(fitted, fitted)], inner * 30.0 / 90.0, atol=1e-12)
    # differences do not depend on what the walk is counted from
    change = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert change @ walk_kernel(time, fitted) @ change == pytest.approx(1.0)
    # records of units have their own times
    time = np.stack([np.linspace(0.0, 50.0, 6), np.linspace(7.0, 107.0, 6)])
    both = walk_kernel(time)
    np.testing.assert_allclose(both[1], walk_kernel(time[1]) * 100.0 / 107.0, atol=1e-12)
    assert np.trace(both[1]) / np.trace(both[0]) == pytest.approx(2.0)


def test_the_allan_deviation_of_a_process_has_its_maximum_where_the_literature_has_it() -> None:
    tau = np.linspace(1.7, 2.1, 4001)
    curve = np.sqrt(allan_variance(tau, 1.0))
    assert tau[np.argmax(curve)] == pytest.approx(1.893, abs=1e-3)
    assert curve.max() == pytest.approx(0.6174, abs=1e-4)
    assert pytest.approx(1.893, rel=2e-4) == AT_MAXIMUM
    short, long = 1e-4, 1e5
    assert allan_variance(short, 1.0) == pytest.approx(2.0 * short / 3.0, rel=1e-3)  # a walk with K² = 2/T
    assert allan_variance(long, 1.0) == pytest.approx(2.0 / long, rel=1e-3)  # white with N² = 2T
    assert allan_variance(np.array([9.99e-4, 1.001e-3]), 1.0) == pytest.approx(2.0 / 3e3, rel=3e-3)


@pytest.mark.parametrize(("count", "within"), [(3, 0.09), (4, 0.02)])
def test_terms_hold_flicker_over_three_decades(count: int, within: float) -> None:
    terms = flicker_terms(1.0, 1000.0, count)
    tau = np.logspace(0.0, 3.0, 400)
    deviation = np.sqrt((terms.sd**2 * allan_variance(tau[:, None], terms.correlation_s)).sum(axis=1))
    assert np.max(np.abs(deviation / np.sqrt(FLICKER_VARIANCE) - 1.0)) < within
    assert terms.flatness < within
    assert len(terms.sd) == count


@pytest.mark.parametrize(("correlation_s", "seconds"), [(0.5, 1.0), (40.0, 1.0), (1e4, 2.0), (3.0, 30.0)])
def test_a_step_has_the_covariances_of_the_integrals(correlation_s: float, seconds: float) -> None:
    """The stationary covariance s²·e^(−|t|/T), integrated over the step numerically."""
    sd, end = 2.0, seconds
    step = step_of_process(sd, correlation_s, seconds)
    covariance = lambda a, b: sd**2 * np.exp(-abs(a - b) / correlation_s)  # noqa: E731
    lower = dblquad(covariance, 0.0, seconds, 0.0, lambda a: a, epsabs=1e-12, epsrel=1e-10)[0]
    mean = 2.0 * lower / seconds**2
    grid = (np.arange(20_000) + 0.5) * seconds / 20_000
    with_end, with_start = (float(np.mean([covariance(t, place) for t in grid])) for place in (end, 0.0))
    assert step.weight == pytest.approx(with_start / sd**2, rel=1e-6)
    assert step.weight**2 * sd**2 + step.mean_variance == pytest.approx(mean, rel=1e-8)
    assert step.keep * step.weight * sd**2 + step.covariance == pytest.approx(with_end, rel=1e-6)
    assert step.keep**2 * sd**2 + step.end_variance == pytest.approx(sd**2, rel=1e-12)


def test_the_series_of_short_steps_continues_the_closed_form() -> None:
    above, below = (step_of_process(1.0, 1.0, 1e-3 + apart).mean_variance for apart in (1e-9, -1e-9))
    assert above == pytest.approx(below, rel=1e-5)
    slow, walk = step_of_process(1.0, 1e9, 1.0), step_of_walk(np.sqrt(2e-9), 1.0)  # K² = 2s²/T
    assert (slow.mean_variance, slow.covariance) == pytest.approx((walk.mean_variance, walk.covariance), rel=1e-6)


DT_S, TIME_S, RECORDS = 0.1, 60.0, 4000


@pytest.mark.parametrize("term", ["N", "B", "K"])
def test_the_errors_are_those_of_integrated_noise(term):
    rng, n = np.random.default_rng(20_261), round(TIME_S / DT_S)
    white = rng.standard_normal((RECORDS, n))
    made = {
        "N": 2.0 * white / np.sqrt(DT_S),  # σ(τ) = N/√τ
        "B": np.repeat(2.0 * white[:, :1], n, axis=1),
        "K": 2.0 * np.cumsum(white, axis=1) * np.sqrt(DT_S),
    }[term]
    got = navigation_error({term: 2.0}, "m/s^2", np.array([TIME_S]))
    velocity = np.cumsum(made, axis=1) * DT_S
    assert got.velocity[0] == pytest.approx(velocity[:, -1].std(), rel=0.05)
    assert got.position[0] == pytest.approx((np.sum(velocity, axis=1) * DT_S).std(), rel=0.05)


def test_velocity_random_walk_is_sixty_times_the_density():
    # 25 µg/√Hz, the ADXL355 of the notes: 25e-6 · 9.80665 · 60 = 0.0147 m/s/√h
    got = navigation_error({"N": 25.0, "B": 20.0, "K": None}, "µg", np.array([3600.0]))
    assert got.velocity_random_walk == pytest.approx(0.01471, rel=1e-3)
    assert (got.q_n, got.q_b) == pytest.approx(((25e-6 * PER_G) ** 2, (20e-6 * PER_G) ** 2))
    assert got.velocity[0] == pytest.approx(np.hypot(0.01471, 20e-6 * PER_G * 3600.0), rel=1e-3)
    unknown = navigation_error({"N": None, "B": 1.0}, "mg", np.array([1.0]))
    assert (unknown.velocity_random_walk, unknown.q_n) == (None, None)
