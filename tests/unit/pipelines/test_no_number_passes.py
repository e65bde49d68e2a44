"""What is no number passes no comparison: it is refused, told, or stays no number."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

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


def test_a_figure_an_axis_or_a_repetition_that_is_no_number_does_not_pass() -> None:
    limits = parse_limits(LIMITS, "t", UNITS)
    for value, u in ((np.nan, 1.0), (10.0, np.nan), (np.inf, 0.0)):
        assert not decide(limits, "bias_error_ug", value, u).passed
    for place in range(3):
        values = [FigureValue("f", axis, np.nan if k == place else 0.1, 0.01) for k, axis in enumerate("xyz")]
        assert np.isnan(worst(values).value)
    row = {"unit": "A", "figure": "bias_error_ug", "axis": "x", "unit_text": "µg", "identified": True, "note": ""}
    for place in range(2):
        rows = [row | {"value": np.nan if k == place else 1.0 + k, "uncertainty": 0.1} for k in range(2)]
        [figure] = _of_procedures(pd.DataFrame(rows), "A", limits)
        assert decide(limits, figure.name, figure.of.value, figure.of.uncertainty).outcome != "pass"
