"""The end of a demonstration says what was told apart, and what was not."""

from typing import Any

import pytest

from pipelines.cli.text.demo_text import print_ending
from pipelines.demo.scenes import scene

NONE = {"rms_ug": 9.0, "heldout_rms_ug": 9.5, "fresh_rms_ug": 9.9, "floor_ug": 4.0}
CLASS = ["aging_log", "warm_up", "thermal_lag"]


def ending(capsys: pytest.CaptureFixture[str], **changes: Any) -> str:
    hidden = scene("warm_up", 0)
    document = {
        "hidden": {"kind": hidden.kind, "effect": hidden.effect, "physics": hidden.truth}, "folder": "game",
        "classes": [CLASS], "unseen": [], "added": ["thermal_lag"], "found": True, "told_apart": False,
        "not_told_apart": [CLASS], "next_measurements": [], "before": NONE, "after": NONE, **changes,
    }  # fmt: skip
    print_ending(document)
    return " ".join(capsys.readouterr().out.split())


def test_an_effect_added_from_a_class_is_not_called_found(capsys: pytest.CaptureFixture[str]) -> None:
    row = {
        "outer_deg": 0.0, "inner_deg": 90.0, "chamber_C": 25.0, "why": "aging_log | warm_up", "minutes": 12.0,
        "separation_before": 0.4, "separation_after": 60.0, "separation_if": {"aging_log": 60.0, "warm_up": 75.0},
        "not_parted": ["thermal_lag"],
    }  # fmt: skip
    said = ending(capsys, next_measurements=[row])
    assert "Found in a class, not separated" in said
    assert (
        "the added effect, thermal_lag, is one of a class; these data fit equally well with aging_log, warm_up." in said
    )
    assert "The measurement that separates them:" in said
    assert "expected 60 if aging_log is true, 75 if warm_up is true; not separated from the first: thermal_lag" in said
    assert "Found." not in said


def test_where_no_measurement_parts_the_class_that_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert "No measurement that the station can take is certain to separate them." in ending(capsys)
    words = {"why": "aging_log | warm_up: no steps of this station are certain to separate them; needed: a power cycle"}
    said = ending(capsys, next_measurements=[words | {"measurable": False}])
    assert "needed: a power cycle" in said


def test_an_effect_that_stands_alone_is_found(capsys: pytest.CaptureFixture[str]) -> None:
    said = ending(capsys, classes=[["warm_up"]], told_apart=True, not_told_apart=[])
    assert "The diagnosis named warm_up. Found." in said
