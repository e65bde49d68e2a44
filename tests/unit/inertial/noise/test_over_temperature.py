"""The curve of a noise density over temperature, and the mean of the Allan variances of several records."""

import numpy as np
import pytest

from inertial.noise.allan import curve_of, variances
from inertial.noise.over_temperature import density_curve
from inertial.noise.terms import fit_terms

LEVELS = np.array([-40.0, -10.0, 25.0, 55.0, 85.0])


def test_the_curve_holds_the_ratio_of_an_exponential_growth() -> None:
    truth = 18.0 * np.exp(0.006 * (LEVELS - 25.0))
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(200):
        curve = density_curve(LEVELS, truth * (1.0 + 0.02 * rng.standard_normal(5)), 0.02 * truth)
        assert curve is not None
        ratio, u = curve.ratio(-40.0, 85.0)
        inside += abs(ratio - np.exp(0.006 * 125.0)) < 2.0 * u
    assert 180 <= inside <= 200  # the misfit only widens: 95 % and more


def test_two_soaks_give_a_line_and_one_temperature_none() -> None:
    curve = density_curve(np.array([0.0, 50.0]), np.array([10.0, 20.0]), np.array([0.1, 0.2]))
    assert curve is not None
    assert curve.ratio(0.0, 50.0)[0] == pytest.approx(2.0)
    assert curve.at(np.array([25.0]))[0] == pytest.approx(np.sqrt(200.0))
    assert density_curve(np.array([20.0, 20.2]), np.array([1.0, 1.0]), np.array([0.1, 0.1])) is None


def test_soaks_at_nearly_one_temperature_do_not_bend_the_curve() -> None:
    pairs = np.array([24.4, 24.6, 84.4, 84.6])
    curve = density_curve(pairs, np.array([20.0, 20.5, 30.5, 30.0]), np.full(4, 0.3))
    assert curve is not None
    value, u = curve.at(np.array([54.5]))
    assert value[0] == pytest.approx(np.sqrt(20.25 * 30.25), rel=0.01)
    assert u[0] < 1.0
    three = density_curve(np.array([-40.0, 25.0, 25.2, 85.0]), np.full(4, 20.0), np.full(4, 0.3))
    assert three is not None
    assert three.coefficients.size == 3


@pytest.mark.slow
def test_the_mean_of_many_records_holds_n_with_an_interval_that_shrinks_with_their_number() -> None:
    rng, rate, sigma = np.random.default_rng(8), 100.0, 3.0
    inside, widths = 0, []
    for count in (4, 25):
        m, variance = variances(sigma * rng.standard_normal((40, count, 500)), rate)
        terms = fit_terms(curve_of(variance.mean(axis=1), m, 500, rate, count))
        n = terms.symbols.index("N")
        true = sigma / np.sqrt(rate)
        inside += int(np.sum((terms.low[:, n] < true) & (true < terms.high[:, n])))
        widths.append(np.median(terms.high[:, n] - terms.low[:, n]))
    assert inside >= 70  # of 80
    assert widths[0] / widths[1] == pytest.approx(2.5, rel=0.25)
