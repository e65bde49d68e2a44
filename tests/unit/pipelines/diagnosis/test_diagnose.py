"""The diagnosis on small lots of plain physics: nothing where nothing is, the effect where there is one."""

import lots
import numpy as np
import pytest
from each import each
from long_suites import mostly_slow

from benchmarks.hand_turned import make as turned_by_hand
from inertial import frames
from pipelines.diagnosis.compare import compare
from pipelines.diagnosis.diagnose import default_model, diagnose, examination
from pipelines.diagnosis.sentences import unexplained_text, verdict
from schemas.errors import DataRejected


def cubic(force, temperature, time, rng):
    return rng.normal(0.0, 60e-6, 3) * force**3


def test_rivals_that_faces_cannot_part_are_one_class_with_poses_that_would_part_them(rng):
    def square(force, temperature, time, rng):
        return rng.normal(0.0, 80e-6, 3) * force**2

    diagnosis = diagnose(lots.lot(rng, plan="six", temperatures=(0, 25, 50, 25, 0), hidden=square))
    assert {"second_order", "scale_asymmetry"} <= set(diagnosis["classes"][0]["effects"])
    assert diagnosis["recommended"] == ["second_order"]
    assert diagnosis["next_measurements"]
    assert "cross_coupling" in diagnosis["unseen"]


def test_an_effect_that_is_not_there_does_not_look_like_progress_on_a_fresh_run():
    first, fresh = lots.lot(np.random.default_rng(5)), lots.lot(np.random.default_rng(5), noise_ug=10.0)
    fresh[["out_x", "out_y", "out_z"]] += np.random.default_rng(6).normal(0, 10e-6, (len(fresh), 3))
    model = default_model(first)
    plain = compare(first, model, fresh=fresh)
    more = compare(first, [*model, "cross_axis_quadratic", "magnetic"], fresh=fresh)
    assert more["rms_ug"] < plain["rms_ug"]
    assert more["heldout_rms_ug"] > plain["heldout_rms_ug"]


@each([(letters, units) for letters in ("x", "xy", "xyz") for units in (1, 3)])
def test_the_error_by_axis_is_that_of_each_axis_with_an_output(row: tuple[str, int], rng) -> None:
    letters, units = row
    noise_ug = {"x": 10.0, "y": 30.0, "z": 90.0}
    table = lots.lot(rng, units=units, noise_ug=1.0, temperatures=(25.0, 25.0))
    for axis, size in noise_ug.items():
        table[f"out_{axis}"] += rng.normal(0.0, 1e-6 * size, len(table))
    table = table.drop(columns=[f"{name}_{axis}" for axis in set("xyz") - set(letters) for name in ("out", "sd")])
    error = compare(table, ["bias", "scale", "misalignment"])["by_axis"]
    assert list(error) == list(letters)
    for axis in letters:
        assert error[axis] == pytest.approx(noise_ug[axis], rel=0.4)


@pytest.mark.usefixtures("no_next_measurement")
def test_the_same_data_give_the_same_answer_and_what_a_model_or_a_fresh_run_lacks_is_said(rng):
    table = lots.lot(rng, hidden=cubic)
    assert diagnose(table) == diagnose(table.sample(frac=1.0, random_state=1))
    with pytest.raises(DataRejected, match="supply"):
        diagnose(table, effects=["bias", "scale", "misalignment", "supply_sensitivity"])
    with pytest.raises(DataRejected, match="U009"):
        compare(table, default_model(table), fresh=table.assign(unit=table["unit"].replace("U001", "U009")))
    for same in (table, table[table["dwell"] % 2 == 0]):  # the fit's dwells in another file would confirm anything
        with pytest.raises(DataRejected, match="exactly the outputs of dwells of the fit"):
            compare(table, default_model(table), fresh=same)


@pytest.mark.usefixtures("no_next_measurement")
@pytest.mark.parametrize("alike_ug", mostly_slow([0.0, 20.0], 20.0))
def test_what_of_the_residual_all_units_have_in_common_is_said_with_its_size(rng, alike_ug: float) -> None:
    table = lots.lot(rng, units=6, noise_ug=10.0, temperatures=(25.0, 25.0))
    wander = rng.normal(0.0, 1e-6 * alike_ug, (table["dwell"].max() + 1, 3))
    table[["out_x", "out_y", "out_z"]] += wander[table["dwell"]]
    texts = [text for text in diagnose(table)["warnings"] if "common to all 6 units" in text]
    assert len(texts) == (alike_ug > 0.0)
    for text in texts:
        shared, single = (float(part.split()[-1]) for part in text.split(" µg")[:2])
        assert shared == pytest.approx(alike_ug, rel=0.25)
        assert single == pytest.approx(10.0, rel=0.25)


@pytest.mark.usefixtures("no_next_measurement")
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_deviations_of_the_samples_in_another_unit_than_the_outputs_are_told(rng, unit: float) -> None:
    table = lots.lot(rng, units=3, noise_ug=10.0, temperatures=(25.0, 25.0))
    table[["sd_x", "sd_y", "sd_z"]], table["n"] = unit * 100e-6, 100
    texts = [text for text in diagnose(table)["warnings"] if "check the unit of sd" in text]
    assert len(texts) == (unit > 1.0)
    for text in texts:
        assert float(text.split(" µg")[0].split()[-1]) == pytest.approx(10000.0, rel=0.01)


@pytest.mark.usefixtures("no_next_measurement")
def test_effects_of_a_table_are_told_to_be_untried_where_its_angles_are_missing(rng) -> None:
    table = lots.lot(rng, units=2, temperatures=(25.0, 25.0))
    angles = ["outer_deg", "inner_deg"]
    forces = table.drop(columns=angles)
    forces[["force_x", "force_y", "force_z"]] = frames.force_from_angles(*np.deg2rad(table[angles].to_numpy().T))
    follows = {"driver": "pose", "shape": "curve", "text": "the error follows pose", "period_s": None, "p_value": 1e-9}
    plain = table.drop(columns=["unit_C", "chamber_C"], errors="ignore")
    told = [
        unexplained_text({**examination(known, None, None).document, "unexplained": {**follows, "driver": driver}})
        for known, driver in ((table, "pose"), (forces, "pose"), (plain, "time_s"))
    ]
    assert "angles" not in told[0]
    assert "backlash" in told[1]
    assert "record outer_deg and inner_deg" in told[1]
    assert "more could not be tried: record them in the column unit_C" in told[2]


@pytest.mark.slow
def test_an_effect_that_noise_seldom_explains_is_suspected_with_what_decides_it_where_none_is_named() -> None:
    """Preisach's operator in 39 dwells of one unit: beside a random walk the evidence does not reach that of a name."""
    document = examination(turned_by_hand("hysteresis", 9101), None, None).document
    suspected = document["suspected"]
    assert document["adequate"] is False
    assert not document["recommended"]
    assert suspected["effects"] == ["thermal_hysteresis"]
    assert suspected["named_below"] < suspected["p_value"] < 0.05
    assert suspected["rms_after_ug"] < 0.3 * document["error"]["rms_ug"]
    assert "suspected, but not named: thermal_hysteresis" in verdict(document)
    assert "closed loop of temperature" in verdict(document)
    assert diagnose(turned_by_hand("lag", 9100))["suspected"] is None
