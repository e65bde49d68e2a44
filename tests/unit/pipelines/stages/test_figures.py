"""Figures that are judged: the one nearest to its limit with U, with the k of the limits, and none where nothing was measured."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipelines.stages.figures import UNITS, Figure, UnitTables, figures_of
from pipelines.stages.figures.base import LotCoefficients
from pipelines.stages.grade import GradeEvidence, grade
from pipelines.tables.frames import ByUnit
from schemas.limits import parse_limits

LIMITS = """
name = "test"
rule = "guarded_acceptance"
coverage_factor = 2.5
[figures]
velocity_random_walk_ug_rtHz = { max = 100.0, unit = "µg/√Hz" }
"""


def calibration(values: np.ndarray, errors: np.ndarray) -> SimpleNamespace:
    """One unit whose only effect is a bias, g."""

    def of(effect: str, what: np.ndarray) -> np.ndarray:
        return what[None, :, None] if effect == "bias" else np.zeros((1, 3, 0))

    known = {"units": ("A",), "axes": (0, 1, 2), "scale": np.ones((1, 3))}
    return SimpleNamespace(**known, value=lambda e: of(e, values), standard_error=lambda e: of(e, errors))


@pytest.mark.parametrize(("guard", "value", "error"), [(0.0, 9.0, 0.1), (2.5, 8.0, 1.0)])
def test_the_coefficient_nearest_its_limit_with_its_uncertainty_is_judged(
    guard: float, value: float, error: float
) -> None:
    lot = LotCoefficients(calibration(np.array([9e-3, -8e-3, 1e-3]), np.array([1e-4, 1e-3, 1e-3])), 0.0)
    nearest = lot.of(0).nearest("bias", 1e3, guard)
    assert abs(nearest.value) == pytest.approx(value)
    assert nearest.uncertainty == pytest.approx(error)


def noise_rows(*, silent: bool) -> pd.DataFrame:
    rows = []
    for axis in "xyz":
        dead = silent and axis == "y"
        for term, unit in (("N", "µg/√Hz"), ("B", "µg"), ("K", "µg/√s"), ("B_bound", "µg")):
            value, high = (np.nan, np.nan) if dead else (10.0, 12.0)
            rows.append(("A", axis, term, value, 8.0, high, not dead, unit, "the output never changed" if dead else ""))
    return pd.DataFrame(
        rows, columns=["unit", "axis", "term", "value", "low", "high", "identified", "unit_text", "note"]
    )


def evidence(*, silent: bool) -> GradeEvidence:
    """Tables of one unit without coefficients of the figures' effects."""
    verdicts = pd.DataFrame({"unit": ["A"], "slot": [1], "refused": [False], "fault": [""], "reason": [""]})
    coefficients = pd.DataFrame(
        {"unit": "A", "axis": list("xyz") * 2, "effect": ["bias"] * 3 + ["scale"] * 3, "name": ["K0"] * 3 + ["K1"] * 3,
         "value": [0.001] * 3 + [1.0] * 3, "standard_error": 1e-5, "unit_text": "g"}
    )  # fmt: skip
    covariance = pd.DataFrame(
        [("A", axis, r, c, 1e-10 * (r == c)) for axis in "xyz" for r in range(2) for c in range(r + 1)],
        columns=["unit", "axis", "row", "column", "value"],
    )
    residuals = pd.DataFrame({"unit": "A", "residual_ug": [3.0, -4.0]})
    empty = pd.DataFrame({"unit": pd.Series(dtype=str)})
    return GradeEvidence(verdicts, coefficients, covariance, residuals, empty, empty, noise_rows(silent=silent))


def test_a_silent_axis_passes_no_limit_and_is_named_and_figures_without_a_limit_carry_the_k_of_the_limits() -> None:
    limits = parse_limits(LIMITS, "test", UNITS)
    tables = grade(evidence(silent=True), limits)
    row = tables["grades"].iloc[0]
    assert row["outcome"] == "fail"
    assert "velocity_random_walk_ug_rtHz: not determined (axis y: the output never changed)" in row["reasons"]
    assert np.isfinite(tables["figures"]["value"]).all()
    tables = grade(evidence(silent=False), limits)
    assert tables["grades"].iloc[0]["outcome"] == "pass"
    own = tables["figures"].set_index("figure").loc["residual_rms_ug"]
    assert own["uncertainty"] == pytest.approx(2.5 * 5.0 / np.sqrt(2.0) / np.sqrt(4.0))
    assert own["outcome"] == "no limit"


def test_the_rms_error_carries_the_uncertainty_of_its_covariance_where_the_run_has_it() -> None:
    rows = pd.DataFrame(
        {"unit": "A", "error_ug": [1.0, 2.0], "uncertainty_ug": 1.0, "reading_ug": 1.0, "error_x_ug": [30.0, 40.0],
         "error_y_ug": [1.0, 1.0], "error_z_ug": [1.0, 1.0]}
    )  # fmt: skip
    poses = pd.DataFrame({"unit": "A", "error_ug": [1.5], "uncertainty_ug": [1.0]})
    residuals = pd.DataFrame({"unit": "A", "residual_ug": [1.0]})
    none = pd.DataFrame({"unit": pd.Series(dtype=str)})

    def figure(table: pd.DataFrame) -> Figure:
        without = LotCoefficients(calibration(np.zeros(3), np.zeros(3)), 0.0).of(0)
        tables = UnitTables(*(ByUnit(t).of("A") for t in (residuals, table, poses, none)), without, 2.0)
        return next(f for f in figures_of(tables) if f.name == "bias_error_ug")

    assert figure(rows).of.uncertainty == pytest.approx(np.sqrt(1250.0) / 2.0)
    told = rows.assign(rms_uncertainty_x_ug=7.0, rms_uncertainty_y_ug=1.0, rms_uncertainty_z_ug=1.0)
    one = figure(told)
    assert (one.unit, *one.of[:3]) == ("µg", pytest.approx(np.sqrt(1250.0)), 7.0, "")
