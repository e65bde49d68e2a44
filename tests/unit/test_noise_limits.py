"""Where no mixture of the five terms explains an Allan curve, each term is given its ceiling, not a value."""

import numpy as np

from inertial.noise.allan import overlapping
from inertial.noise.terms import FLICKER_FLOOR, fit_terms
from pipelines.stages.noise import limits_where_unexplained


def test_a_curve_that_no_mixture_explains_gives_ceilings_only(rng: np.random.Generator) -> None:
    n, rate = 40000, 100.0
    hum = 300.0 * np.sin(2.0 * np.pi * 0.7 * np.arange(n) / rate)
    curve = overlapping(rng.normal(size=(1, n)) + hum, rate)
    fitted = fit_terms(curve)
    assert fitted.p_value[0] < 1e-6
    terms = limits_where_unexplained(curve, fitted)
    assert np.all(np.isnan(terms.value))
    assert np.isclose(terms.high[0, terms.symbols.index("B")], np.min(curve.high) / FLICKER_FLOOR)
    assert np.isclose(terms.high[0, terms.symbols.index("N")], np.min(curve.high * np.sqrt(curve.tau)))


def test_a_curve_that_white_noise_explains_keeps_its_terms(rng: np.random.Generator) -> None:
    curve = overlapping(rng.normal(size=(1, 20000)), 100.0)
    terms = limits_where_unexplained(curve, fit_terms(curve))
    assert np.isclose(terms.value[0, terms.symbols.index("N")], 0.1, rtol=0.05)
