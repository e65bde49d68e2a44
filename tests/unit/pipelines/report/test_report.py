"""Reasons of decisions as they are shown, and the numbers of procedures: labels, digits, signs."""

from types import SimpleNamespace

import numpy as np
import pytest
from long_suites import mostly_slow

from benchmarks.truth import Spec, make_run
from pipelines.diagnosis.diagnose import examination
from pipelines.procedures.figures import probability, signed, with_uncertainty
from pipelines.report.context import UnitContext
from pipelines.report.numbers import with_uncertainty as in_tables
from pipelines.report.residual_table import residual_table
from pipelines.report.residuals import drivers_shown
from pipelines.stages.figures import FIGURES, plain_reason


def test_a_figure_has_its_label_and_other_reasons_stay() -> None:
    said = " fail: 1200 ± 3 µg, limit 1000 µg, margin -200 µg; grade reached: none, grade required: consumer"
    for name in FIGURES:
        shown = plain_reason(name + said)
        assert name not in shown.split()
        assert shown.lower().startswith(FIGURES[name].label.lower())
        assert said in shown
    for text in ("", "unit_C: 3 readings are missing; the unit stopped answering at record 3"):
        assert plain_reason(text) == text
    reasons = "; ".join(f"{n} fail: 2" for n in FIGURES)
    row = {"unit": "A1", "slot": 0, "outcome": "fail", "grade": "none", "reasons": reasons}
    unit = UnitContext(SimpleNamespace(certificates={}), row)  # pyright: ignore[reportArgumentType]
    assert not [reason for reason, name in zip(unit.reasons, FIGURES, strict=True) if reason.startswith(name)]


def test_numbers_have_the_digits_of_their_uncertainty_a_sign_and_no_negative_zero() -> None:
    for value, expanded, text in (
        (-507.77, 614.0, "−510 ± 610"), (4158.8, 131.2, "4160 ± 130"), (-0.0409, 1.0, "0.0 ± 1.0"),
        (1.3794, 0.1712, "1.38 ± 0.17"), (2177.51, 2.39, "2177.5 ± 2.4"), (3.2, 0.0, "3.2"), (-3.2, float("nan"), "−3.2"),
        (-1.538e-9, 2.3e-11, "−1.538e−09 ± 2.3e−11"),
    ):  # fmt: skip
        assert with_uncertainty(value, expanded) == text
    differences = {-0.04: "0.0", 0.04: "0.0", 0.0: "0.0", -0.06: "−0.1", 0.2: "+0.2", -2.345: "−2.3", 12.0: "+12.0"}
    assert {value: signed(value, 1) for value in differences} == differences
    assert in_tables(-0.0409, 1.0) == ("0.0", "1.0")
    assert [probability(p) for p in (0.68, 3.2e-12, 0.0)] == ["p = 0.68", "p < 0.001", "p < 0.001"]


FIRST = [("third_order", "force"), ("encoder_harmonic", "outer_deg"), ("aging_log", "since_power_s")]


@pytest.mark.parametrize(("effect", "first"), mostly_slow(FIRST, FIRST[0]))
def test_the_first_picture_is_the_quantity_of_the_missing_effect(effect: str, first: str) -> None:
    lot = make_run(Spec(effects=(effect,), sizes=(4.0,), units=3), 5)
    made = examination(lot.dwells, lot.history, lot.sealed.spec.base)
    assert drivers_shown(made.diagnosis)[0].name == first
    table = residual_table(made.measured, made.diagnosis, made.measured.units)
    assert table.first == first
    before = table.residual[0, 0]
    along = table.drivers[first][1][0]
    along = along[:, 0] if along.ndim > 1 else along
    if first == "force":  # f = x + h·x³ less the line that bias and scale take: odd, and three zeros
        assert abs(np.corrcoef(before, along**3 - np.polyval(np.polyfit(along, along**3, 1), along))[0, 1]) > 0.7
