"""What is said in worlds that nobody prepared; their generator shares nothing with the estimator."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from inertial import effects as catalogue
from inertial.criticism.field import Candidates
from inertial.criticism.unseen import unseen
from inertial.data_errors.handling.wrong_pose import WrongPose
from inertial.estimation.likelihood import scatter_of_poses
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.space import Gain
from pipelines.diagnosis.diagnose import diagnose
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

import part
from noise import Noise
from tables import FAULTS, HIDDEN, NULLS
from world import World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")

BASE = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
SEED = 5_500_000


def said(world: World, seed: int) -> dict:
    made = make(world, seed)
    return {**diagnose(made.dwells, made.history), "told": made.told, "faults": made.faults}


def names(document: dict) -> list[list[str]]:
    return [group["effects"] for group in document["classes"]]


def test_a_random_walk_is_no_physics():
    document = said(NULLS["K8"], SEED)
    assert document["adequate"] is True
    assert names(document) == []
    assert document["error"]["walk_share"] > 100.0
    # soaks that only climb hide any hysteresis that is narrower than their steps
    (dark,) = (row for row in document["unseen_in_part"] if row["effect"] == "thermal_hysteresis")
    assert (dark["parameter"], dark["from"]) == ("half_width", pytest.approx(1.0))
    assert 15.0 < dark["to"] < 35.0


def test_a_walk_over_the_record_does_not_hide_a_cubic_that_stands_out_between_neighbours():
    # a fifth of the noise of a dwell about the record's mean, most of which is walk: 20 of 116 µg, p below 1e-10
    made = make(World(units=2, poses=12, hidden=(("third_order", 0.2),), noise=Noise(walk=4.0)), 41_000_007)
    document = diagnose(made.dwells, made.history)
    (group,) = document["classes"]
    assert "third_order" in group["effects"]
    assert group["size_ug"] < 0.2 * document["error"]["floor_ug"]
    assert document["adequate"] is False


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
@pytest.mark.parametrize("name", sorted(set(FAULTS) - {"moved_one_unit"}))
@pytest.mark.parametrize("seed", [SEED + 3, SEED + 4])
def test_every_fault_is_told_and_no_physics_beside_it(name, seed):
    document = said(FAULTS[name], seed)
    for told in document["faults"]:
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
    # with three soaks an offset of one is, beside linear terms, an offset of another: all three are said
    assert "0.5" in document["classes"][0]["evidence"]
    assert document["classes"][0]["evidence"].count("K off in soak") == 3
    assert document["recommended"] == []


@pytest.mark.parametrize(("rest", "least", "most"), [(0.0, 1.0, 1.0), (20.0, 2.0, 8.0)])
def test_what_is_said_of_the_station_stands_out_of_the_scatter_of_all_poses(rest, least, most):
    made = make(World(soaks=(25.0,), repeats=2, rest=rest), SEED)
    problem = Problem(lot_of(measured(made.dwells, made.history)))
    model = Model(problem, terms_of(catalogue.get_all(BASE[:3]), problem))
    # 20 µrad of rest beside 10 µg of the mean of eight units: about 1 + (20/10)² in variance
    assert least <= scatter_of_poses(model) <= most


@pytest.mark.parametrize("history", [True, False])
def test_the_scatter_of_a_thermometer_shows_no_narrow_hysteresis(history):
    made, rng = make(World(units=1, poses=12), SEED), np.random.default_rng(3)
    tables = [made.dwells.copy(), made.history.copy()]
    for table in tables:
        table["unit_C"] += 0.1 * rng.standard_normal(len(table))
    problem = Problem(lot_of(measured(tables[0], tables[1] if history else None)))
    base = Model(problem, terms_of(catalogue.get_all(BASE), problem))
    effect = catalogue.get("thermal_hysteresis")
    (_, ranges), *_ = unseen(Candidates(problem, [effect]), base, [effect])[1]
    # soaks that only climb by 35 K hide a play that is narrower
    assert ranges[0].low == 1.0
    assert 15.0 < ranges[0].high < 35.0


def test_a_step_between_soaks_does_not_stand_alone_before_hysteresis():
    soaks = (25.0, 60.0, -10.0, 20.0)
    document = said(World(units=4, poses=6, soaks=soaks, hidden=(("thermal_hysteresis", 4.0),)), SEED)
    assert any({"thermal_hysteresis", "step_change"} <= set(group) for group in names(document))


@pytest.mark.parametrize("scene", ["creep on faces", "creep on faces, shuffled"])
def test_a_creep_on_six_faces_is_named_alone(scene):
    # the table turned before the first dwell: the state of the creep there is unknown, and looks like a warm-up of seconds;
    # its way from face to face leads through other directions, which looks like a product of two forces
    document = diagnose(*part.Continued(part.SCENES[scene], SEED).tables())
    assert names(document) == [["creep_after_move"]]
    assert document["unexplained"] is None


def test_heavy_tails_name_nothing_and_the_dwells_left_out_are_listed():
    document = said(NULLS["t3"], SEED)
    assert names(document) == []
    assert document["removed"] is None or document["removed"]["heavy_tails"] is True


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(SEED + 10, SEED + 14))
def test_heavy_tails_of_a_lot_are_no_bad_dwells(seed):
    assert names(said(NULLS["t3"], seed)) == []


def test_devices_that_had_not_soaked_are_told_alone_with_their_time_constant():
    document = said(replace(FAULTS["unsoaked"], units=3), SEED)
    (group,) = document["classes"]
    assert "device_not_soaked" in group["effects"]
    assert group["scope"] == "data"
    assert float(group["evidence"].split("time constant of ")[1].split(" s")[0]) == pytest.approx(300.0, rel=0.1)
    assert document["recommended"] == []
    assert document["error"]["rms_ug"] < 1.2 * document["error"]["floor_ug"]


def test_one_unit_that_had_not_soaked_is_named():
    document = said(replace(FAULTS["unit_unsoaked"], units=3), SEED)
    (group,) = document["classes"]
    assert (group["effects"][0], tuple(group["units"])) == ("unit_not_soaked", document["told"].units)


def test_two_faults_of_one_unit_are_both_told():
    document = said(replace(FAULTS["dwell_of_moved"], units=4), SEED)
    moved, dwell = document["faults"]
    by_name = {group["effects"][0]: group for group in document["classes"]}
    assert set(by_name) == {"unit_moved", "bad_dwell"}
    assert by_name["bad_dwell"]["dwells"] == list(dwell.dwells)
    assert tuple(by_name["unit_moved"]["units"]) == tuple(by_name["bad_dwell"]["units"]) == moved.units
    assert by_name["unit_moved"]["without_influence"]["p_value"] < 1e-3
    assert {row["unit"] for row in by_name["unit_moved"]["influence"]} == set(moved.units)


def test_a_converters_nonlinearity_in_a_lot_of_eight_is_one_name():
    assert names(said(HIDDEN["adc_nonlinearity_5"], SEED)) == [["adc_nonlinearity"]]


def test_where_every_unit_has_a_fault_nothing_is_said_of_adequacy():
    document = said(replace(NULLS["lsb5"], units=2), SEED)
    assert document["adequate"] is None
    assert "every unit (2)" in document["reason"]


def test_a_column_of_one_dwell_gains_the_same_without_being_whitened():
    made = make(World(units=3, durations=(2.0, 60.0), noise=Noise(unit_white=(5.0, 1.0, 1.0))), SEED)
    dwells = made.dwells.drop(
        index=made.dwells.index[(made.dwells["unit"] == "W002") & made.dwells["dwell"].isin([5, 6])]
    )
    problem = Problem(lot_of(measured(dwells, made.history)))
    model = Model(problem, terms_of(catalogue.get_all([*BASE, "level_error"]), problem))
    field = Candidates(problem, [], [WrongPose()])
    quick = field.gains(model.space, set(), handling=True)["wrong_pose"]
    pieces = problem.pieces(WrongPose(), field.grids["wrong_pose"])
    plain = Gain.joined([model.space.gain(piece) for piece in pieces])
    np.testing.assert_array_equal(quick.rank, plain.rank)
    np.testing.assert_allclose(quick.drop, plain.drop, rtol=1e-6, atol=1e-6)


def test_a_converter_coarser_than_the_noise_is_a_fault():
    assert {fault["fault"] for fault in said(NULLS["lsb5"], SEED)["blocked_by"]} == {"quantised"}


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
