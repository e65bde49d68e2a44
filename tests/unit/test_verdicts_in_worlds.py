"""What is said in worlds that nobody prepared; their generator shares nothing with the estimator."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines.diagnosis.compare import compare
from pipelines.diagnosis.diagnose import diagnose

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from noise import Noise
from tables import FAULTS, NULLS
from world import World, make

BASE = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
SEED = 5_500_000


def said(world: World, seed: int) -> dict:
    made = make(world, seed)
    return {**diagnose(made.dwells, made.history), "told": made.told}


def names(document: dict) -> list[list[str]]:
    return [group["effects"] for group in document["classes"]]


def test_a_random_walk_is_no_physics():
    document = said(NULLS["K8"], SEED)
    assert document["adequate"] is True
    assert names(document) == []
    assert document["error"]["walk_share"] > 100.0


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(NULLS) - {"lsb5", "many_units"}))
@pytest.mark.parametrize("seed", [SEED + 1, SEED + 2])
def test_nothing_is_named_where_nothing_is_hidden(name, seed):
    assert names(said(NULLS[name], seed)) == []


def test_one_dwell_that_is_off_is_named_and_no_physics():
    document = said(FAULTS["dwell_0.5mg"], SEED)
    (group,) = document["classes"]
    assert (group["effects"], group["scope"]) == (["bad_dwell"], "data")
    assert (tuple(group["units"]), tuple(group["dwells"])) == (document["told"].units, document["told"].dwells)
    assert document["influence"][0] == {"unit": group["units"][0], "dwell": group["dwells"][0], "share": 1.0}
    assert document["recommended"] == []
    assert document["adequate"] is False


def test_a_unit_that_moved_is_told_with_the_time_and_the_angle():
    document = said(FAULTS["moved_0.2mrad"], SEED)
    group = document["classes"][0]
    assert (group["effects"][0], group["scope"]) == ("unit_moved", "data")
    assert tuple(group["units"]) == document["told"].units
    assert abs(group["dwells"][0] - document["told"].dwells[0]) <= 1
    assert "mrad about" in group["evidence"]
    assert document["recommended"] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(FAULTS) - {"unsoaked", "moved_one_unit"}))
@pytest.mark.parametrize("seed", [SEED + 3, SEED + 4])
def test_every_fault_is_told_and_no_physics_beside_it(name, seed):
    document = said(FAULTS[name], seed)
    told = document["told"]
    assert set(told.names) & {name for group in names(document) for name in group}
    assert all(group["scope"] == "data" for group in document["classes"])


def test_a_pose_that_is_off_for_all_is_told_for_all():
    document = said(FAULTS["pose_2deg"], SEED)
    group = document["classes"][0]
    assert "wrong_pose" in group["effects"]
    assert group["units"] == []
    assert tuple(group["dwells"]) == document["told"].dwells
    assert document["blocked_by"] == []
    assert not any(g["scope"] != "data" for g in document["classes"])


def test_a_thermometer_that_is_off_in_a_soak_is_one_parameter_of_the_lot():
    document = said(FAULTS["thermometer_0.5K"], SEED)
    assert document["classes"][0]["effects"][0] == "soak_thermometer"
    assert "0.5" in document["classes"][0]["evidence"]
    assert document["recommended"] == []


def test_heavy_tails_name_nothing_and_the_dwells_left_out_are_listed():
    document = said(NULLS["t3"], SEED)
    assert names(document) == []
    assert document["removed"] is None or document["removed"]["heavy_tails"] is True


def test_a_converter_coarser_than_the_noise_is_a_fault():
    assert {fault["fault"] for fault in said(NULLS["lsb5"], SEED)["blocked_by"]} == {"quantised"}


def progress(world: World, effect: str, seed: int, *, fresh: bool = True) -> dict:
    made = make(world, seed)
    again = (made.fresh, made.fresh_history) if fresh else (None, None)
    return compare(made.dwells, [*BASE, effect], made.history, *again, before=BASE)["progress"]


def test_a_cubic_is_confirmed_where_units_come_up_elsewhere():
    found = progress(World(units=2, turn_on=300.0, hidden=(("third_order", 2.0),)), "third_order", SEED)
    assert found["confirmed"] is True
    assert found["part"] == pytest.approx(1.0, abs=4.0 * found["part_u"])
    assert found["fall_ug"] > 3.0 * found["fall_u_ug"] > 0.0


@pytest.mark.parametrize("effect", ["bias_temperature_quadratic", "aging_log", "thermal_hysteresis", "step_change"])
def test_slow_effects_that_are_not_there_are_not_confirmed(effect):
    world = World(units=2, noise=Noise(walk=4.0))
    assert progress(world, effect, SEED)["confirmed"] is not True
    assert progress(world, effect, SEED, fresh=False)["confirmed"] is None


def test_what_carries_a_verdict_is_listed_and_it_stands_without():
    document = said(World(units=4, hidden=(("third_order", 2.0),)), SEED)
    assert document["recommended"] == ["third_order"]
    assert document["classes"][0]["heldout_after_ug"] < document["classes"][0]["heldout_before_ug"]
    assert 0 < len(document["influence"]) <= 8
    assert all(0.0 < row["share"] < 0.5 for row in document["influence"])
    assert document["without_influence"]["p_value"] < 1e-6


def test_units_with_times_and_gaps_of_their_own_are_judged_together():
    made = make(replace(World(units=3), hidden=(("cross_coupling", 2.0),)), SEED)
    dwells = made.dwells.copy()
    late = dwells["unit"] == "W002"
    dwells.loc[late, "time_s"] += 40.0
    dwells = dwells.drop(index=dwells.index[(dwells["unit"] == "W003") & dwells["dwell"].isin([5, 6, 40])])
    document = diagnose(dwells, made.history)
    assert names(document) == [["cross_coupling"]]
