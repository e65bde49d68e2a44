"""Limits, decision rules and grades."""

import pandas as pd
import pytest
from each import each
from hypothesis import given
from hypothesis import strategies as st

from pipelines.jobs.recipes import read_limits, sample_names
from pipelines.stages.figures import UNITS
from pipelines.stages.grade import _of_procedures
from schemas.decisions import GRADES, beside_limit, decide, digits_beside, grade_with
from schemas.errors import RecipeInvalid
from schemas.limits import Limits, parse_limits

TEXT = """
name = "test"
rule = "{rule}"
[figures]
bias_error_ug = {{ max = 100.0, unit = "µg" }}
"""
LEAST = """
name = "bandwidth"
rule = "{rule}"
[figures]
sweep_bandwidth_hz = {{ min = 800.0, unit = "Hz" }}
"""


def limits(rule: str = "guarded_acceptance") -> Limits:
    return parse_limits(TEXT.format(rule=rule), "limits test", UNITS)


def test_names_value_uncertainty_limit_margin_and_rule() -> None:
    decision = decide(limits(), "bias_error_ug", 130.0, 5.0)
    assert decision.sentence == "bias_error_ug fail: 130 ± 10 µg, limit 100 µg, margin -30 µg"
    near = {(16.247, 16.25): "16.247", (16.254, 16.25): "16.254", (16.2, 16.25): "16.2", (1234.56, 1000.0): "1235"}
    for (value, limit), told in near.items():  # the digits show on which side of the limit the value lies
        assert beside_limit(value, 0.57, limit, " mg") == f"{told} ± 0.57 mg, limit {limit:g} mg"
    assert [digits_beside(limit, limit) for limit in (16.25, 1000.0, 0.5)] == [4, 3, 3]
    inside, beyond = (decide(limits(), "bias_error_ug", value, 5.0).sentence for value in (95.0, 105.0))
    assert inside == (
        "bias_error_ug not accepted: inside the guard band, 95 ± 10 µg, limit 100 µg, probability of exceeding it 16 %: "
        "measure longer, or again"
    )
    assert (
        "above the limit by less than its uncertainty, 105 ± 10 µg, limit 100 µg, probability of exceeding it 84"
        in beyond
    )
    assert decision.rule == "ILAC-G8:09/2019 guarded acceptance, w = U with k = 2"


@each([
    ('"µg"', '"mg"', "the limit is in mg, the figure is in µg"),
    ("bias_error_ug", "bias_eror_ug", "did you mean bias_error_ug"),
    ("{rule}", "none", "rule.*guarded_acceptance"),
])  # fmt: skip
def test_refuses_limits_by_what_is_wrong_in_them(row: tuple[str, str, str]) -> None:
    old, new, said = row
    with pytest.raises(RecipeInvalid, match=said):
        parse_limits(TEXT.replace(old, new).format(rule="simple_acceptance"), "limits test", UNITS)
    for text, message in (("max = 1.0, min = 2.0, ", "both given"), ("", "neither given")):  # a limit has one side
        with pytest.raises(RecipeInvalid, match=message):
            parse_limits(f'name = "x"\n[figures]\nsweep_bandwidth_hz = {{ {text}unit = "Hz" }}\n', "test", UNITS)


@given(st.floats(0.0, 3000.0), st.floats(0.0, 500.0))
def test_uncertainty_never_raises_a_grade(value: float, expanded: float) -> None:
    order = [*GRADES, None]
    sure, unsure = (grade_with(value, u) for u in (0.0, expanded))
    assert order.index(unsure) >= order.index(sure)
    for bias, grade in ((30.0, "navigation"), (150.0, "industrial"), (700.0, "consumer"), (1500.0, None)):
        assert grade_with(bias, 0.0) == grade
    assert set(sample_names("limits-")) - {"production", "practice"} == set(GRADES)


@each([
    (TEXT, 80.0, "pass", "pass"),
    (TEXT, 95.0, "conditional pass", "pass"),
    (TEXT, 105.0, "conditional fail", "fail"),
    (TEXT, 115.0, "fail", "fail"),
    (TEXT, -115.0, "fail", "fail"),
    (LEAST, 820.0, "pass", "pass"),
    (LEAST, 805.0, "conditional pass", "pass"),
    (LEAST, 795.0, "conditional fail", "fail"),
    (LEAST, 700.0, "fail", "fail"),
    (LEAST, -900.0, "fail", "fail"),
    (LEAST, float("nan"), "conditional fail", "conditional fail"),  # passes nothing
])  # fmt: skip
def test_decides_by_the_agreed_rule(row: tuple[str, float, str, str]) -> None:
    text, value, *expected = row
    figure, accept = ("bias_error_ug", 90.0) if text == TEXT else ("sweep_bandwidth_hz", 810.0)
    decisions = [
        decide(parse_limits(text.format(rule=rule), "test", UNITS), figure, value, 5.0)
        for rule in ("guarded_acceptance", "simple_acceptance")
    ]
    assert [one.outcome for one in decisions] == expected
    assert decisions[0].accept == accept


def test_a_least_value_says_its_side_margin_and_risk_and_is_refused_where_the_largest_axis_is_kept(tmp_path) -> None:
    own = parse_limits(LEAST.format(rule="guarded_acceptance"), "test", UNITS)
    decision = decide(own, "sweep_bandwidth_hz", 780.0, 5.0)
    assert "limit at least 800 Hz, margin -20 Hz" in decision.sentence
    assert decide(own, "sweep_bandwidth_hz", 800.0, 5.0).risk == pytest.approx(0.5)
    rows = [
        {"unit": "A", "figure": "sweep_bandwidth_hz", "axis": axis, "value": value, "uncertainty": 5.0, "identified": True,
         "unit_text": "Hz", "note": ""}
        for axis, value in (("x", 950.0), ("y", 805.0), ("z", 990.0))
    ]  # fmt: skip
    assert [one.of.value for one in _of_procedures(pd.DataFrame(rows), "A", own)] == [805.0]  # the smallest of the axes
    least = 'name = "least"\n[figures]\nturn_on_repeatability_ug = { min = 5.0, unit = "µg" }\n'
    (tmp_path / "least.toml").write_text(least, encoding="utf-8")
    with pytest.raises(RecipeInvalid, match="largest of the axes is judged"):
        read_limits("least.toml", tmp_path)
