"""What is no number passes no comparison: it is refused, told, or stays no number."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from inertial.errors import NotIdentified
from inertial.fits.ellipsoid import fit_ellipsoid
from inertial.fits.wander import lack_of_fit
from inertial.noise.allan import overlapping
from inertial.noise.terms import fit_terms
from inertial.population.change_points import change_points
from inertial.population.comparison import holm
from pipelines.audit.exchanged_serials import _within
from pipelines.procedures.figures import FigureValue, worst
from pipelines.stages.figures import UNITS
from pipelines.stages.grade import _of_procedures
from pipelines.stages.noise import limits_where_unexplained
from schemas.decisions import decide
from schemas.limits import parse_limits

LIMITS = 'name = "t"\nrule = "guarded_acceptance"\n[figures]\nbias_error_ug = { max = 100.0, unit = "µg" }\n'


def sphere(n: int = 24) -> np.ndarray:
    way = np.random.default_rng(1).standard_normal((n, 3))
    return way / np.linalg.norm(way, axis=1, keepdims=True)


def test_a_sphere_fit_refuses_a_dwell_that_is_no_number() -> None:
    output = sphere()
    output[7, 1] = np.nan
    with pytest.raises(NotIdentified, match="dwell 7 is not finite"):
        fit_ellipsoid(output)
    heat = np.full(24, 20.0)
    heat[3] = np.inf
    with pytest.raises(NotIdentified, match="dwell 3 is not finite"):
        fit_ellipsoid(sphere(), temperature=heat)


def test_a_misfit_that_is_no_number_is_no_good_fit() -> None:
    assert np.isnan(lack_of_fit(np.array([np.nan, 5.0]), 5)[0])


def test_a_curve_without_a_probability_has_limits_only(rng: np.random.Generator) -> None:
    curve = overlapping(rng.normal(size=(1, 4000)), 100.0)
    terms = fit_terms(curve)
    terms.chi2[:] = np.nan
    assert np.isnan(limits_where_unexplained(curve, terms).value).all()


def test_a_unit_of_which_nothing_is_known_fits_nobodys_past() -> None:
    bound = np.array([1.0, np.inf])
    for new, error, fits in ((0.5, 0.1, True), (5.0, 0.1, False), (np.nan, 0.1, False), (0.5, np.nan, False)):
        values = np.array([[0.0, 0.0], [new, 3.0]])
        errors = np.array([[0.1, 0.1], [error, 0.1]])
        assert _within(SimpleNamespace(values=values, errors=errors), 1, 0, bound) is fits


def test_a_comparison_that_could_not_be_made_spoils_no_other() -> None:
    np.testing.assert_allclose(holm(np.array([0.001, np.nan, 0.2])), [0.003, 1.0, 0.4])


def test_a_series_with_a_gap_has_no_change() -> None:
    assert change_points(np.array([1.0, np.nan] * 20)) == []


@pytest.mark.parametrize(("value", "u"), [(np.nan, 1.0), (10.0, np.nan), (np.inf, 0.0)])
def test_a_figure_that_is_no_number_does_not_pass(value: float, u: float) -> None:
    assert not decide(parse_limits(LIMITS, "t", UNITS), "bias_error_ug", value, u).passed


@pytest.mark.parametrize("place", [0, 1, 2])
def test_an_axis_that_is_no_number_decides(place: int) -> None:
    values = [FigureValue("f", axis, 0.1, 0.01) for axis in "xyz"]
    values[place] = FigureValue("f", "xyz"[place], np.nan, 0.01)
    assert np.isnan(worst(values).value)


@pytest.mark.parametrize("place", [0, 1])
def test_a_repeated_procedure_that_is_no_number_decides(place: int) -> None:
    limits = parse_limits(LIMITS, "test", UNITS)
    row = {"unit": "A", "figure": "bias_error_ug", "axis": "x", "unit_text": "µg", "identified": True, "note": ""}
    rows = [row | {"value": 1.0, "uncertainty": 0.1}, row | {"value": 2.0, "uncertainty": 0.1}]
    rows[place]["value"] = np.nan
    [figure] = _of_procedures(pd.DataFrame(rows), "A", limits)
    assert decide(limits, figure.name, figure.value, figure.uncertainty).outcome != "pass"
