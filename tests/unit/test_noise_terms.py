"""Noise coefficients come back from records made independently, with limits where the data say nothing."""

import numpy as np
import pytest

from inertial.noise import generate
from inertial.noise.allan import overlapping
from inertial.noise.psd import allan_variance, one_sided
from inertial.noise.terms import FLICKER_FLOOR, fit_terms, model_deviation

RATE = 100.0
SHAPE = (12, 60_000)


def test_a_simulated_one_sided_density_comes_back() -> None:
    terms = fit_terms(overlapping(generate.white(np.random.default_rng(1), SHAPE, 280e-6, RATE), RATE))
    assert np.mean(terms.density_one_sided) == pytest.approx(280e-6, rel=0.005)
    assert np.mean(terms.value[:, 1]) == pytest.approx(280e-6 / np.sqrt(2.0), rel=0.005)


def test_white_noise_alone_identifies_nothing_else() -> None:
    terms = fit_terms(overlapping(generate.white(np.random.default_rng(4), SHAPE, 1.0, RATE), RATE))
    others = terms.value[:, [0, 2, 3, 4]]
    assert np.isnan(others).mean() > 0.9
    assert np.all(terms.high > 0.0)
    assert "not identified, ≤" in terms.one(0)["K"].text("g")


@pytest.mark.parametrize(
    ("symbol", "truth"),
    [("Q", 2e-5), ("N", 1e-4), ("B", 1e-4), ("K", 3e-5)],
    ids=["Q", "N", "B", "K"],
)
def test_each_coefficient_comes_back_inside_its_interval(symbol: str, truth: float) -> None:
    rng, shape = np.random.default_rng(7), (40, 30_000)
    x = generate.white(rng, shape, {"Q": 2e-6, "N": truth * np.sqrt(2.0), "B": 5e-5, "K": 1e-5}[symbol], RATE)
    x = (
        x
        + {
            "Q": lambda: generate.quantisation(rng, shape, truth, RATE),
            "N": lambda: 0.0,
            "B": lambda: generate.flicker(rng, shape, truth),
            "K": lambda: generate.random_walk(rng, shape, truth, RATE),
        }[symbol]()
    )
    terms = fit_terms(overlapping(x, RATE), confidence=0.95)
    j = terms.symbols.index(symbol)
    covered = (terms.low[:, j] <= truth) & (truth <= terms.high[:, j])
    assert np.sum(covered) >= 35
    assert np.nanmean(terms.value[:, j]) == pytest.approx(truth, rel=0.03)


def test_a_ramp_is_identified() -> None:
    rng = np.random.default_rng(3)
    ramp = 1e-6 * np.arange(SHAPE[1]) / RATE
    terms = fit_terms(overlapping(generate.white(rng, SHAPE, 1e-5, RATE) + ramp, RATE))
    assert np.nanmean(terms.value[:, 4]) == pytest.approx(1e-6, rel=0.03)


def test_intervals_of_a_mixture_cover() -> None:
    rng = np.random.default_rng(9)
    shape = (60, 40_000)
    x = generate.white(rng, shape, 1e-4 * np.sqrt(2.0), RATE) + generate.flicker(rng, shape, 3e-5)
    terms = fit_terms(overlapping(x, RATE), confidence=0.95)
    for j, truth in ((1, 1e-4), (2, 3e-5)):
        covered = np.mean((terms.low[:, j] <= truth) & (truth <= terms.high[:, j]))
        assert covered > 0.85, (terms.symbols[j], covered)


def test_the_minimum_over_0_664_is_only_a_bound_when_white_noise_and_random_walk_meet() -> None:
    n, k = 1e-4, 1e-6 * 100.0
    rng, shape = np.random.default_rng(12), (8, 120_000)
    x = generate.white(rng, shape, n * np.sqrt(2.0), RATE) + generate.random_walk(rng, shape, k, RATE)
    terms = fit_terms(overlapping(x, RATE))
    assert np.mean(terms.bias_instability_bound) == pytest.approx(np.sqrt(2.617 * n * k), rel=0.06)
    assert np.isnan(terms.value[:, 2]).sum() >= 7


def test_0_664_times_the_minimum_is_not_the_bias_instability() -> None:
    rng = np.random.default_rng(6)
    x = generate.flicker(rng, SHAPE, 1.0) + generate.white(rng, SHAPE, 0.1, RATE)
    curve = overlapping(x, RATE)
    floor = np.mean(curve.deviation[:, 7:12])
    assert floor / FLICKER_FLOOR == pytest.approx(1.0, rel=0.03)
    assert 0.664 * floor < 0.5
    assert np.nanmean(fit_terms(curve).value[:, 2]) == pytest.approx(1.0, rel=0.03)


def test_the_model_line_passes_through_the_points() -> None:
    curve = overlapping(generate.white(np.random.default_rng(2), (2, 50_000), 1.0, RATE), RATE)
    line = model_deviation(fit_terms(curve), curve.tau)
    np.testing.assert_allclose(line[:, :8], curve.deviation[:, :8], rtol=0.1)


def test_spectrum_and_allan_variance_say_the_same() -> None:
    rng = np.random.default_rng(10)
    x = generate.white(rng, (16, 2**16), 1.0, 1.0) + generate.flicker(rng, (16, 2**16), 1.0)
    spectrum = one_sided(x, 1.0, segment=2**13)
    curve = overlapping(x, 1.0, np.array([16, 64, 128]))
    expected = allan_variance(spectrum.frequency, spectrum.density.mean(axis=0), curve.tau)
    np.testing.assert_allclose(np.mean(curve.deviation**2, axis=0), expected, rtol=0.05)


def test_a_white_density_is_read_off_the_spectrum_as_one_sided() -> None:
    x = generate.white(np.random.default_rng(0), (4, 2**15), 25e-6, 250.0)
    assert np.median(one_sided(x, 250.0).amplitude) == pytest.approx(25e-6, rel=0.03)


def test_refuses_a_constant_channel() -> None:
    x = np.random.default_rng(0).normal(size=(2, 1000))
    x[1] = 0.25
    with pytest.raises(ValueError, match=r"channel \(1,\) has zero Allan deviation"):
        fit_terms(overlapping(x, 10.0))


def test_refuses_a_record_with_too_few_averaging_times() -> None:
    with pytest.raises(ValueError, match="at least 6 are needed"):
        fit_terms(overlapping(np.random.default_rng(0).normal(size=40), 10.0))
