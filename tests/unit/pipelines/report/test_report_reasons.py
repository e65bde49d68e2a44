"""Reasons of decisions as they are shown: figures by their labels, texts that name none as they are."""

from types import SimpleNamespace

from pipelines.report.context import UnitContext
from pipelines.report.reasons import plain_reason
from pipelines.stages.figures import FIGURES


def test_a_figure_has_its_label_and_other_reasons_stay() -> None:
    said = " fail: 1200 ± 3 µg, limit 1000 µg, margin -200 µg; grade none: grade consumer is needed"
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
    assert len(unit.reasons) == len(FIGURES)
    assert not [reason for reason, name in zip(unit.reasons, FIGURES, strict=True) if reason.startswith(name)]
