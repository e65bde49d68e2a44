"""What is no number passes no comparison: it is refused, told, or stays no number."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipelines.audit.exchanged_serials import _within
from pipelines.procedures.figures import FigureValue, worst
from pipelines.stages.figures import UNITS
from pipelines.stages.grade import _of_procedures
from schemas.decisions import decide
from schemas.limits import parse_limits

LIMITS = 'name = "t"\nrule = "guarded_acceptance"\n[figures]\nbias_error_ug = { max = 100.0, unit = "µg" }\n'


def test_a_unit_of_which_nothing_is_known_fits_nobodys_past() -> None:
    bound = np.array([1.0, np.inf])
    for new, error, fits in ((0.5, 0.1, True), (5.0, 0.1, False), (np.nan, 0.1, False), (0.5, np.nan, False)):
        values = np.array([[0.0, 0.0], [new, 3.0]])
        errors = np.array([[0.1, 0.1], [error, 0.1]])
        assert _within(SimpleNamespace(values=values, errors=errors), 1, 0, bound) is fits


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
