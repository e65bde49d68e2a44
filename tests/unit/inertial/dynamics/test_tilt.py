"""Linearity and orthogonality by tilt where the truth is drawn."""

import numpy as np
import pytest
from long_suites import mostly_slow
from scipy.stats import binom, chi2, norm

from inertial.dynamics.tilt import TiltFit, fit_tilt, magnitude


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


@pytest.mark.parametrize(
    ("k2", "k3"), mostly_slow([(0.0, 0.0), (0.0, 2e-4), (8e-4, 1.6e-3), (-8e-4, 1.6e-3)], (-8e-4, 1.6e-3))
)
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
