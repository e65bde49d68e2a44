"""Intervals of test procedures where the truth is drawn: stability of an hour, linearity and orthogonality by tilt."""

import numpy as np
import pytest
from scipy.stats import binom, chi2, norm

from inertial.dynamics.stability import deviation_interval, stability
from inertial.dynamics.tilt import TiltFit, fit_tilt, magnitude
from inertial.dynamics.wandering_means import IdentifiedNoise

SECONDS, RUNS = 3600, 300


def hours(rng: np.random.Generator, white: float, flicker: float) -> tuple[np.ndarray, np.ndarray]:
    """Means of 1 s over an hour (RUNS, 3600) of white noise and of 1/f noise of density ``flicker``²/f, and its densities.

    The 1/f noise ends at a period of sixteen hours, of which an hour is cut out.
    """
    long = 16 * SECONDS
    f = np.arange(1, long // 2 + 1) / long
    density = flicker**2 / f
    records = np.empty((RUNS, SECONDS))
    for k in range(RUNS):
        z = rng.normal(size=(2, f.size))
        spectrum = np.concatenate([[0.0], (z[0] + 1j * z[1]) * np.sqrt(density * long / 4.0)])
        records[k] = np.fft.irfft(spectrum, long)[:SECONDS] + white * rng.normal(size=SECONDS)
    return records, density


def expected(white: float, density: np.ndarray, walk: float) -> tuple[float, float]:
    """Roots of the expected variance of 36 means of 100 s, and of the Allan variance at 100 s."""
    f = np.arange(1, density.size + 1) / (2.0 * density.size)
    mean = np.array([np.sin(100.0 * np.pi * x) / (100.0 * np.sin(np.pi * x)) for x in f]) ** 2
    lag = np.array([np.sum(density * mean * np.cos(200.0 * np.pi * f * j)) for j in range(36)]) * f[0]
    covariance = lag[np.abs(np.subtract.outer(np.arange(36), np.arange(36)))] + np.eye(36) * white**2 / 100.0
    at = np.arange(36)
    covariance = covariance + 100.0 * walk**2 * (
        np.minimum.outer(at, at) + np.where(np.equal.outer(at, at), 1 / 3, 0.5)
    )
    spread = np.trace(covariance) / 36.0 - np.mean(covariance)
    return float(np.sqrt(36.0 / 35.0 * spread)), float(
        np.sqrt(lag[0] - lag[1] + white**2 / 100.0 + 100.0 / 3.0 * walk**2)
    )


@pytest.mark.parametrize(
    ("white", "flicker", "walk"),
    [(10.0, 0.0, 0.0), (10.0, 5.0, 0.0), (3.0, 50.0, 0.0), (10.0, 5.0, 1.0), (10.0, 0.0, 5.0)],
)
@pytest.mark.parametrize("shown", ["by the hour alone", "by a static record"])
def test_the_intervals_of_an_hour_hold_the_process(
    white: float, flicker: float, walk: float, shown: str, rng: np.random.Generator
) -> None:
    records, density = hours(rng, white, flicker)
    records = records + walk * np.cumsum(rng.normal(size=records.shape), axis=1)
    sd, allan = expected(white, density, walk)
    # as a static record has them, to a quarter; what is not there has a limit
    ends = [
        (size, 0.7 * size, 1.4 * size) if size else (np.nan, 0.0, 0.02) for size in (flicker * np.sqrt(np.pi), walk)
    ]
    identified = IdentifiedNoise(ends[0], ends[1]) if shown == "by a static record" else None
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


def test_a_magnitude_is_without_that_of_its_noise(rng: np.random.Generator) -> None:
    for true in (3.0, 5.0, 12.0):
        magnitudes = [magnitude(true + e, 1.0) for e in rng.normal(size=4000)]
        assert np.mean(magnitudes) == pytest.approx(true, abs=3.0 / np.sqrt(4000.0) + 0.03)
    assert magnitude(0.5, 1.0) == 0.0
    assert magnitude(-20.0, 1.0) == 20.0
    assert magnitude(-3.0, 0.0) == 3.0
    noise = rng.normal(size=4000)
    assert np.mean([magnitude(e, 1.0) for e in noise]) < 0.7 * np.mean(np.abs(noise))
    # the size whose mean magnitude is the value: by a sum over the quantiles of the normal distribution
    steps = norm.ppf((np.arange(100_000) + 0.5) / 100_000)
    assert np.mean(np.abs(magnitude(1.7, 1.0) + steps)) == pytest.approx(1.7, abs=1e-3)


def turn(rng: np.random.Generator, k2: float, k3: float, white: float, angle_error: float) -> tuple[TiltFit, TiltFit]:
    """Both axes of a plane over a turn every 15°, with the same error of the table at each angle."""
    asked = np.asarray(np.arange(24) * np.pi / 12.0, dtype=np.float64)
    true = asked + angle_error * rng.normal(size=24)
    fits: list[TiltFit] = []
    for force in (np.sin(true), np.cos(true)):
        output = force + k2 * force**2 + k3 * force**3 + white * rng.normal(size=24)
        phase = 0.0 if not fits else 0.5 * np.pi
        error = np.hypot(white, angle_error * np.abs(np.cos(asked + phase)))
        fits.append(fit_tilt(asked, output, error, orders=3))
    return fits[0], fits[1]


def test_errors_of_the_table_that_both_axes_share_count_once(rng: np.random.Generator) -> None:
    pulls, apart = [], []
    for _ in range(300):
        one, other = turn(rng, 0.0, 0.0, 1e-5, 2e-4)
        value = other.phase[0] - one.phase[0] - 0.5 * np.pi
        variance = one.phase[1] ** 2 + other.phase[1] ** 2
        pulls.append(value / np.sqrt(variance - 2.0 * one.phase_covariance(other, 2e-4)))
        apart.append(value / np.sqrt(variance))
    low, high = np.sqrt(chi2.ppf([0.005, 0.995], 299) / 299)
    assert low < np.std(pulls, ddof=1) < high
    assert not low < np.std(apart, ddof=1) < high


@pytest.mark.parametrize(("k2", "k3"), [(0.0, 0.0), (0.0, 2e-4), (8e-4, 1.6e-3), (-8e-4, 1.6e-3)])
def test_the_departure_by_tilt_is_that_of_the_curve(k2: float, k3: float, rng: np.random.Generator) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 3601)[:-1]
    force = np.sin(angle)
    rows = np.column_stack([np.ones_like(angle), force, np.cos(angle)])
    curve = k2 * force**2 + k3 * force**3
    true = float(np.max(np.abs(curve - rows @ np.linalg.lstsq(rows, curve, rcond=None)[0])))
    departures = [turn(rng, k2, k3, 1e-4, 0.0)[0].departure for _ in range(300)]
    held = sum(max(0.0, value - 1.96 * error) <= true <= value + 1.96 * error for value, error in departures)
    assert held >= binom.ppf(0.005, 300, 0.95)
    pulls = [(value - true) / error for value, error in departures]
    if k2:  # both terms stand out of the noise: the pulls are normal
        low, high = np.sqrt(chi2.ppf([0.005, 0.995], 299) / 299)
        assert low < np.std(pulls, ddof=1) < high
        assert abs(np.mean(pulls)) < 2.6 / np.sqrt(300.0)


def test_the_spread_of_a_residual_is_that_of_many_turns(rng: np.random.Generator) -> None:
    fits = [turn(rng, 0.0, 0.0, 1e-4, 0.0)[0] for _ in range(400)]
    residuals = np.array([one.residuals for one in fits])
    assert fits[0].spread == pytest.approx(residuals.std(axis=0), rel=0.15)  # 0.035 by chance, 24 values
    assert np.sqrt(np.mean(fits[0].spread ** 2)) == pytest.approx(np.sqrt(np.mean(residuals**2)), rel=0.03)
