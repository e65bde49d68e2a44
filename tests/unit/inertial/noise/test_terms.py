"""Noise coefficients come back from records made independently, with limits where the data say nothing."""

from dataclasses import replace

import independent_noise as made
import made_noise as generate
import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.noise.allan import overlapping
from inertial.noise.terms import FLICKER_FLOOR, fit_terms, model_deviation
from pipelines.stages.noise import limits_where_unexplained

RATE = 100.0
SHAPE = (12, 60_000)


def test_white_noise_has_its_one_sided_density_and_identifies_nothing_else() -> None:
    curve = overlapping(generate.white(np.random.default_rng(1), SHAPE, 280e-6, RATE), RATE)
    terms = fit_terms(curve)
    assert terms.symbols.index("N") == 1
    assert np.mean(terms.value[:, 1]) == pytest.approx(280e-6 / np.sqrt(2.0), rel=0.005)
    assert np.isnan(terms.value[:, [0, 2, 3, 4]]).mean() > 0.9
    assert np.all(terms.high > 0.0)
    assert not terms.one(0)["K"].identified
    np.testing.assert_allclose(model_deviation(terms, curve.tau)[:, :8], curve.deviation[:, :8], rtol=0.1)
    np.testing.assert_array_equal(limits_where_unexplained(curve, terms).value, terms.value)  # what explains it stays
    terms.chi2[:] = np.nan  # a curve without a probability has limits only
    assert np.isnan(limits_where_unexplained(curve, terms).value).all()


MADE = {  # truth, the density of white noise beside it, and how it is made
    "Q": (2e-5, 2e-6, lambda rng, shape, size: generate.quantisation(rng, shape, size, RATE)),
    "N": (1e-4, 1e-4 * np.sqrt(2.0), lambda *_: 0.0),
    "B": (1e-4, 5e-5, generate.flicker),
    "K": (3e-5, 1e-5, lambda rng, shape, size: generate.random_walk(rng, shape, size, RATE)),
    "R": (1e-6, 1e-5, lambda _, shape, size: size * np.arange(shape[1]) / RATE),
}


@pytest.mark.parametrize("symbol", mostly_slow(MADE, "R"))
def test_each_coefficient_comes_back_inside_its_interval(symbol: str) -> None:
    rng, shape, (truth, white, made_of) = np.random.default_rng(7), (20, 30_000), MADE[symbol]
    x = generate.white(rng, shape, white, RATE) + made_of(rng, shape, truth)
    terms = fit_terms(overlapping(x, RATE))
    j = terms.symbols.index(symbol)
    covered = (terms.low[:, j] <= truth) & (truth <= terms.high[:, j])
    assert np.sum(covered) >= 17
    assert np.nanmean(terms.value[:, j]) == pytest.approx(truth, rel=0.03)


@pytest.mark.slow
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


def test_refuses_a_constant_channel_and_a_record_with_too_few_averaging_times() -> None:
    x = np.random.default_rng(0).normal(size=(2, 1000))
    x[1] = 0.25
    with pytest.raises(ValueError, match=r"channel \(1,\) has zero Allan deviation"):
        fit_terms(overlapping(x, 10.0))
    with pytest.raises(ValueError, match="at least 6 are needed"):
        fit_terms(overlapping(x[0, :40], 10.0))


def test_a_curve_that_no_mixture_explains_gives_ceilings_only(rng: np.random.Generator) -> None:
    n, rate = 40000, 100.0
    hum = 300.0 * np.sin(2.0 * np.pi * 0.7 * np.arange(n) / rate)
    curve = overlapping(rng.normal(size=(1, n)) + hum, rate)
    fitted = fit_terms(curve)
    assert fitted.p_value[0] < 1e-6
    terms = limits_where_unexplained(curve, fitted)
    assert np.all(np.isnan(terms.value))
    assert np.min(curve.high) / FLICKER_FLOOR < terms.high[0, terms.symbols.index("B")] < np.max(curve.high)
    assert 1.0 < terms.high[0, terms.symbols.index("N")] * np.sqrt(rate) < 8.0


@pytest.mark.slow
def test_ceilings_hold_in_95_of_100_records_though_each_is_the_least_of_many() -> None:
    held = []
    for k in range(40):
        curve = overlapping(np.random.default_rng([612, k]).standard_normal((3, 8000)), 1.0)
        terms = limits_where_unexplained(curve, replace(fit_terms(curve), chi2=np.full(3, np.inf)))
        held += (terms.high[:, terms.symbols.index("N")] >= 1.0).tolist()
    assert np.mean(held) >= 0.93


PER_S, SAMPLES = 10.0, 12_000


@pytest.mark.slow
def test_a_walk_makes_no_ramp_and_no_interval_of_an_identified_term_reaches_zero() -> None:
    rng = np.random.default_rng(7_310_001)
    x = np.concatenate(
        [made.white(rng, 24, SAMPLES, 100.0, PER_S) + made.walk(rng, 24, SAMPLES, k, PER_S) for k in (1.0, 5.0)]
    )
    terms = fit_terms(overlapping(x, PER_S))
    known = np.isfinite(terms.value)
    assert np.all(terms.low[known] > 0.0)
    assert known[:, terms.symbols.index("R")].sum() <= 1  # 13 of 48 before
    truth = np.repeat([1.0, 5.0], 24)
    walk = terms.high[:, terms.symbols.index("K")] >= truth
    assert walk.sum() >= 44  # 40 before
