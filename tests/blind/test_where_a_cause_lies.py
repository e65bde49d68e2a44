"""Causes of lots whose makers know nothing of the judge: sensor, station or handling, and what is recommended of them."""

import pytest
from truth import case

from benchmarks.hand_turned import EFFECTS
from benchmarks.hand_turned import make as turned_by_hand
from benchmarks.made_recordings import Recording
from benchmarks.made_recordings import make as recorded
from benchmarks.strangers import make
from pipelines.diagnosis.diagnose import diagnose


def hidden(scenario: str, index: int):
    run = case(scenario, index, 5150)
    assert not run.sealed.spec.base
    return diagnose(run.dwells, history=run.history if run.sealed.spec.history else None)


def strange(kind: str, seed: int, size: float = 2.0):
    lot = make(kind, seed, size=size)
    return diagnose(lot.dwells, lot.history), lot


def test_a_pivot_that_sticks_is_in_the_class_though_the_bias_runs_with_temperature():
    document = hidden("lot8_size1", 40)
    assert [set(group["effects"]) for group in document["classes"]] == [{"bias_asymmetry", "dead_zone"}]
    assert document["classes"][0]["scope"] == "sensor"


@pytest.mark.parametrize(("index", "effect"), [(39, "backlash"), (35, "pose_hysteresis")])
def test_an_effect_with_memory_is_judged_on_dwells_left_out(index, effect):
    document = hidden("lot8_size2", index)
    (group,) = document["classes"]
    assert (group["effects"], document["recommended"]) == ([effect], [effect])
    assert group["heldout_after_ug"] < 1.1 * document["error"]["floor_ug"]
    assert group["heldout_after_ug"] < 0.6 * group["heldout_before_ug"]


@pytest.mark.parametrize("seed", [95001, 5950001])
def test_a_unit_that_was_seated_again_is_told_with_its_bias_and_without_physics(seed):
    document, lot = strange("unit_seated_again", seed, 20.0)
    told = {group["effects"][0]: group for group in document["classes"] if group["scope"] == "data"}
    assert set(told) == {"unit_moved", "bias_step"}
    assert all(group["units"] == list(lot.truth["units"]) for group in told.values())
    assert abs(told["bias_step"]["dwells"][0] - min(lot.truth["dwells"])) <= 1
    # what the devices really have, where the plan has one temperature
    assert set(document["recommended"]) <= {"bias_temperature", "scale_temperature"}


@pytest.mark.parametrize("seed", [420004, 420006])
def test_a_run_at_one_temperature_names_the_linear_coefficients_of_its_wander(seed):
    document, _ = strange("null", seed)
    assert sorted(document["recommended"]) == ["bias_temperature", "scale_temperature"]


def test_what_is_alike_in_all_units_may_be_of_the_station():
    document, _ = strange("encoder_slips", 95001, 20.0)
    physics = [group for group in document["classes"] if group["scope"] != "data"]
    assert physics
    assert {group["scope"] for group in physics} == {"sensor or station"}


@pytest.mark.parametrize("name", ["warm_up", "temperature_curve", "lag", "cubic"])
def test_an_effect_of_ten_times_the_noise_is_named_in_one_unit_turned_by_hand(name):
    document = diagnose(turned_by_hand(name, 77))
    right = EFFECTS[name][3]
    assert [bool(right & set(group["effects"])) for group in document["classes"]] == [True]
    assert right & set(document["recommended"])


@pytest.mark.parametrize("seed", [5150006, 5150012])
def test_the_first_dwells_of_a_warm_up_are_not_bad(seed):
    warm = Recording(40, "white 280, B 30", warm_up=2000.0)
    groups = [set(group["effects"]) for group in diagnose(recorded(warm, seed).dwells)["classes"]]
    assert ["warm_up" in group for group in groups] == [True]


def test_a_bad_dwell_is_no_warm_up():
    spoilt = recorded(Recording(24, "white 25, B 30", bad=1, bad_ug=5000.0), 5150002)
    (group,) = diagnose(spoilt.dwells)["classes"]
    assert (group["effects"], tuple(group["dwells"])) == (["bad_dwell"], spoilt.spoilt)


def test_what_follows_the_sequence_of_the_poses_is_no_driver():
    document, _ = strange("sticking_pivot", 12, 6.0)
    assert [one["driver"] for one in document["where"]] == ["pose"]
