"""Scores follow their definitions."""

import pytest
from each import each

from benchmarks.score import score, table, text, wilson
from benchmarks.truth import Fault, Hidden, Spec, Truth


def hidden(name, scope="sensor", *, visible=True):
    return Hidden(name, scope, 2.0, 30.0, 20.0, 0.7, visible, plausible=True)


def truth(*effects, faults=(), drivers=()):
    noise = {"separation": 1.0, "floor_ug": 10.0, "fresh_floor_ug": 10.0, "oracle_fresh_ug": 10.2, "output_per_g": 1.0}
    driven = {"driver": drivers[0] if drivers else None, "accepted_drivers": drivers}
    base = ("bias", "scale", "misalignment")
    return Truth(seed=0, spec=Spec(), base=base, effects=effects, faults=faults, **noise, **driven)


def document(*groups, scope="sensor", **extra):
    classes = [{"effects": list(group), "scope": scope} for group in groups]
    said = {"adequate": not groups, "classes": classes, "blocked_by": [], "recommended": [], "unseen": []}
    return said | {"unexplained": None} | extra


CUBIC, SQUARE = hidden("third_order"), hidden("second_order")
HUMID = truth(hidden("covariate:humidity_pct"), drivers=("humidity_pct",))
TIDE = truth(hidden("withheld:tide"), drivers=("time_s", "time"))
KIP = truth(hidden("cross_coupling", visible=False))
FLIPPED = truth(faults=(Fault("axis_flip", ("U0002",), (), ("axis_flip",)),))
BLOCKED = {"fault": "axis_flip", "units": ["U0002"], "dwells": [], "evidence": ""}


def driven(name):
    return document(unexplained={"driver": name, "shape": "curve"})


SCORES = {
    "truth in a class with company": (
        document(("third_order", "odd_quadratic")), truth(CUBIC), {"in_class": True, "exact": True, "mean_class_size": 2.0}
    ),
    "a second class beside the truth": (
        document(("third_order",), ("aging_linear",)), truth(CUBIC), {"in_class": True, "exact": False}
    ),
    "two truths share a class": (
        document(("second_order", "scale_asymmetry")), truth(SQUARE, hidden("scale_asymmetry")), {"exact": True}
    ),
    "one of two is missing": (
        document(("second_order",)), truth(SQUARE, hidden("backlash", "station")), {"exact": False}
    ),
    "named in a null run": (document(("step_change",)), truth(), {"named_something": True, "exact": None}),
    "station called sensor": (
        document(("level_error", "magnetic")), truth(hidden("level_error", "station")), {"scope_right": False}
    ),
    "sensor called station": (document(("second_order",), scope="station"), truth(SQUARE), {"sensor_called_station": True}),
    "driver as covariate": (document(("covariate:humidity_pct",)), HUMID, {"driver_right": True}),
    "driver as unexplained": (driven("humidity_pct"), HUMID, {"driver_right": True}),
    "another driver": (driven("fan_rpm"), HUMID, {"driver_right": False}),
    "withheld": (driven("time_s"), TIDE, {"none_of_catalogue": True, "driver_right": True}),
    "invisible": (
        document(unseen=["cross_coupling"]), KIP, {"invisible_listed": True, "invisible_named": False, "in_class": None}
    ),
    "fault blocked": (
        document(blocked_by=[BLOCKED]), FLIPPED, {"fault_caught": True, "fault_named": True, "false_fault": False}
    ),
    "fault of another unit": (document(blocked_by=[BLOCKED | {"units": ["U0003"]}]), FLIPPED, {"false_fault": True}),
    "fault missed": (document(), FLIPPED, {"fault_caught": False}),
}  # fmt: skip


@each(SCORES)
def test_scores_follow_their_definitions(name):
    said, true, expected = SCORES[name]
    got = score(said, true).row()
    assert {key: got[key] for key in expected} == expected


@pytest.mark.parametrize(("hits", "count", "low", "high"), [(0, 10, 0.0, 0.2775), (81, 263, 0.2553, 0.3662)])
def test_wilson_interval_agrees_with_the_published_one(hits, count, low, high):
    """Newcombe, Statistics in Medicine 17 (1998), table I, method 3 (81 of 263)."""
    assert wilson(hits, count) == pytest.approx((low, high), abs=2e-4)


def test_table_counts_only_the_runs_a_figure_speaks_of():
    scores = [
        score(document(("third_order",)), truth(hidden("third_order")), scenario="lot8_size2", fresh_rms_ug=10.3),
        score(document(), truth(hidden("third_order")), scenario="lot8_size2", fresh_rms_ug=20.0),
        score(document(), truth(), scenario="null_white"),
    ]
    rows = {row["figure"]: row for row in table(scores)}
    assert rows["lots of 8: exact, size 2"]["value"] == 50.0
    assert rows["null, white: an effect named"]["runs"] == 1
    assert rows["one effect: fresh run ≤ 1.05 of the true noise"]["value"] == 50.0
    assert "exact, size 2" in text(list(rows.values()))
