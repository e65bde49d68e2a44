"""Scores follow their definitions."""

import pytest
from score import score, table, text, wilson
from truth import Fault, Hidden, Spec, Truth


def hidden(name, scope="sensor", *, visible=True):
    return Hidden(name, scope, 2.0, 30.0, 20.0, 0.7, visible, plausible=True)


def truth(*effects, faults=(), drivers=()):
    return Truth(
        seed=0,
        spec=Spec(),
        base=("bias", "scale", "misalignment"),
        effects=effects,
        separation=1.0,
        floor_ug=10.0,
        fresh_floor_ug=10.0,
        oracle_fresh_ug=10.2,
        output_per_g=1.0,
        driver=drivers[0] if drivers else None,
        accepted_drivers=drivers,
        faults=faults,
    )


def document(*groups, scope="sensor", **extra):
    classes = [{"effects": list(group), "scope": scope} for group in groups]
    return {
        "adequate": not groups,
        "blocked_by": [],
        "classes": classes,
        "recommended": [],
        "unexplained": None,
        "unseen": [],
    } | extra


def test_truth_inside_a_class_with_company_is_exact():
    got = score(document(("third_order", "odd_quadratic")), truth(hidden("third_order")))
    assert got.in_class
    assert got.exact
    assert got.mean_class_size == 2.0


def test_a_second_class_beside_the_truth_is_not_exact():
    got = score(document(("third_order",), ("aging_linear",)), truth(hidden("third_order")))
    assert got.in_class
    assert not got.exact


def test_two_classes_for_one_truth_are_one_too_many():
    got = score(document(("third_order",), ("odd_quadratic", "third_order")), truth(hidden("third_order")))
    assert not got.exact


def test_two_truths_may_share_one_class():
    got = score(document(("second_order", "scale_asymmetry")), truth(hidden("second_order"), hidden("scale_asymmetry")))
    assert got.exact


def test_missing_one_of_two_is_not_exact():
    assert not score(document(("second_order",)), truth(hidden("second_order"), hidden("backlash", "station"))).exact


def test_anything_named_in_a_null_run_counts():
    got = score(document(("step_change",)), truth())
    assert got.named_something
    assert got.exact is None


def test_station_effect_called_sensor_is_wrong():
    got = score(document(("level_error", "magnetic")), truth(hidden("level_error", "station")))
    assert got.scope_right is False
    assert score(document(("second_order",), scope="station"), truth(hidden("second_order"))).sensor_called_station


def test_driver_counts_as_covariate_or_as_unexplained():
    humid = truth(hidden("covariate:humidity_pct"), drivers=("humidity_pct",))
    assert score(document(("covariate:humidity_pct",)), humid).driver_right
    assert score(document(unexplained={"driver": "humidity_pct", "shape": "curve"}), humid).driver_right
    assert not score(document(unexplained={"driver": "fan_rpm", "shape": "curve"}), humid).driver_right


def test_withheld_effect_wants_no_name_and_the_driver():
    tide = truth(hidden("withheld:tide"), drivers=("time_s", "time"))
    got = score(document(unexplained={"driver": "time_s", "shape": "curve"}), tide)
    assert got.none_of_catalogue
    assert got.driver_right
    assert not score(document(("aging_log",)), tide).none_of_catalogue


def test_invisible_effect_is_listed_and_not_named():
    kip = truth(hidden("cross_coupling", visible=False))
    got = score(document(unseen=["cross_coupling"]), kip)
    assert got.invisible_listed
    assert not got.invisible_named
    assert got.in_class is None


def test_fault_must_block_its_unit_and_no_other():
    flipped = truth(faults=(Fault("axis_flip", ("U0002",), (), ("axis_flip",)),))
    right = {"fault": "axis_flip", "units": ["U0002"], "dwells": [], "evidence": ""}
    got = score(document(blocked_by=[right]), flipped)
    assert got.fault_caught
    assert got.fault_named
    assert not got.false_fault
    assert score(document(blocked_by=[right | {"units": ["U0003"]}]), flipped).false_fault
    assert not score(document(), flipped).fault_caught
    assert score(document(blocked_by=[right]), truth()).false_fault


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
