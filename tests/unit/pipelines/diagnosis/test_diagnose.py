"""The diagnosis on small lots of plain physics: nothing where nothing is, the effect where there is one."""

import lots
import numpy as np
import pytest

from pipelines.diagnosis.compare import compare
from pipelines.diagnosis.diagnose import default_model, diagnose
from schemas.errors import DataRejected


def cubic(force, temperature, time, rng):
    return rng.normal(0.0, 60e-6, 3) * force**3


def test_a_cubic_transfer_curve_is_named_and_the_error_falls_to_the_floor(rng):
    table = lots.lot(rng, hidden=cubic)
    diagnosis = diagnose(table)
    assert not diagnosis["adequate"]
    assert diagnosis["recommended"] == ["third_order"]
    assert diagnosis["where"][0]["driver"] == "pose"
    before = compare(table, default_model(table))
    after = compare(table, [*default_model(table), "third_order"])
    assert after["rms_ug"] < 1.1 * diagnosis["error"]["floor_ug"] < before["rms_ug"]


def test_rivals_that_faces_cannot_part_are_one_class_with_poses_that_would_part_them(rng):
    def square(force, temperature, time, rng):
        return rng.normal(0.0, 80e-6, 3) * force**2

    diagnosis = diagnose(lots.lot(rng, plan="six", temperatures=(0, 25, 50, 25, 0), hidden=square))
    assert {"second_order", "scale_asymmetry"} <= set(diagnosis["classes"][0]["effects"])
    assert diagnosis["recommended"] == ["second_order"]
    assert diagnosis["next_measurements"]
    assert "cross_coupling" in diagnosis["unseen"]


def test_a_table_out_of_level_is_the_stations_not_the_sensors(rng):
    diagnosis = diagnose(lots.lot(rng, up=(60e-6, -40e-6, 1.0)))
    assert diagnosis["classes"][0]["scope"] == "station"
    assert diagnosis["recommended"] == ["level_error"]


def test_an_unknown_dependence_names_its_driver_and_is_offered_as_a_formula(rng):
    table = lots.lot(rng)
    table["humidity_pct"] = rng.uniform(20, 70, len(table))
    for axis in "xyz":
        table[f"out_{axis}"] += 1e-6 * (table["humidity_pct"] - 45.0)
    diagnosis = diagnose(table)
    assert diagnosis["unexplained"]["driver"] == "humidity_pct"
    assert diagnosis["recommended"] == ["covariate:humidity_pct"]


def test_an_effect_that_is_not_there_does_not_look_like_progress_on_a_fresh_run():
    first, fresh = lots.lot(np.random.default_rng(5)), lots.lot(np.random.default_rng(5), noise_ug=10.0)
    fresh[["out_x", "out_y", "out_z"]] += np.random.default_rng(6).normal(0, 10e-6, (len(fresh), 3))
    model = default_model(first)
    plain = compare(first, model, fresh=fresh)
    more = compare(first, [*model, "cross_axis_quadratic", "magnetic"], fresh=fresh)
    assert more["rms_ug"] < plain["rms_ug"]
    assert more["heldout_rms_ug"] > plain["heldout_rms_ug"]


def test_the_same_data_give_the_same_answer_and_what_a_model_or_a_fresh_run_lacks_is_said(rng):
    table = lots.lot(rng, hidden=cubic)
    assert diagnose(table) == diagnose(table.sample(frac=1.0, random_state=1))
    with pytest.raises(DataRejected, match="supply"):
        diagnose(table, effects=["bias", "scale", "misalignment", "supply_sensitivity"])
    with pytest.raises(DataRejected, match="U009"):
        compare(table, default_model(table), fresh=table.assign(unit=table["unit"].replace("U001", "U009")))


def test_works_from_forces_without_angles_and_without_scatter(rng):
    table = lots.lot(rng, hidden=cubic)
    force = lots.force(np.radians(table[["outer_deg", "inner_deg"]].to_numpy()))
    bare = table.drop(columns=["outer_deg", "inner_deg", "sd_x", "sd_y", "sd_z", "n", "since_move_s"])
    bare[["force_x", "force_y", "force_z"]] = force
    diagnosis = diagnose(bare)
    assert diagnosis["recommended"] == ["third_order"]
    assert "encoder_harmonic" in diagnosis["unseen"]
