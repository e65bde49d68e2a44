"""Calibrations on ramps of the chamber: what the search promises, and what a station measures."""

import json
from pathlib import Path

import numpy as np
import pytest
from capture_double import recipe_file
from in_process import command

from pipelines.archive import Archive
from pipelines.jobs.recipes import load_recipe
from pipelines.planning.requirement import ramp_orders
from pipelines.planning.timed_design import followed_along, short_of
from pipelines.schedule.planned_state import planned_state
from schemas.station import load_station

LEVELS = (-10.0, 60.0)
THERMAL = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
RAMP = """
[[soaks]]
temperature_C = 0.0
poses = {poses}
settled = false

[[soaks]]
temperature_C = 50.0
poses = {poses}
settled = false
"""


def test_ramps_go_from_end_to_end_and_a_ramp_that_stays_short_counts_as_worse():
    assert ramp_orders((-10.0, 25.0, 60.0))[:2] == [(60.0, -10.0), (-10.0, 60.0)]
    assert ramp_orders((25.0,)) == [(25.0,)]
    assert short_of(np.array([-9.0, 58.0]), LEVELS) == 0.0
    assert short_of(np.array([10.0, 58.0]), LEVELS) > 1.0
    heat = followed_along([60.0] * 200, 30.0, 23.0, load_station())
    assert np.all(np.diff(heat) >= 0.0)
    assert heat[-1] == pytest.approx(60.0, abs=1e-3)
    assert heat[10] < 23.0 + 3.0 * 5.25  # 3 K/min for five and a quarter minutes, and the lag


def ramp_recipe(folder: Path, name: str = "ramp") -> str:
    base = Path(recipe_file(folder, ("temperatures_C = [0.0, 50.0]\n", ""), ('["A1", "A2", "A3"]', '["A1"]')))
    text = base.read_text(encoding="utf-8").replace('poses = "nine"', 'poses = "twelve"')
    poses = [*range(1, 13), *range(12, 0, -1)]
    path = folder / f"{name}.toml"
    path.write_text(text + RAMP.format(poses=poses), encoding="utf-8")
    return str(path)


def coefficients(archive: Path):
    run = Archive(archive).run("latest")
    table = run.table("coefficients")
    keys = ["unit", "axis", "effect", "name"]
    return run, table.set_index([key for key in keys if key in table])["value"]


DOOR = ("--fault", "door:at_s=200:for_s=60")


@pytest.mark.slow
@pytest.mark.parametrize("faults", [DOOR, (), ("--fault", "time_out:at_s=250")])
def test_a_station_measures_on_ramps_undisturbed_through_a_lost_answer_and_an_open_door(faults, tmp_path):
    recipe = ramp_recipe(tmp_path)
    done = command(["run", recipe, "--archive", str(tmp_path / "archive"), "--direct", "--json", *faults])
    assert done.returncode in {0, 1}, done.stderr
    document = json.loads(done.stdout)
    assert all(unit["outcome"] != "refused" for unit in document["units"])
    run, _ = coefficients(tmp_path / "archive")
    dwells = run.table("dwells")
    own = dwells[dwells["unit"] == dwells["unit"].iloc[0]]
    assert own["unit_C"].nunique() > 40  # every dwell at a temperature of its own
    if any("door" in fault for fault in faults):
        assert "suspended" in set(run.table("events")["kind"]) or "spoilt" in set(run.table("events")["kind"])


@pytest.mark.slow
def test_a_run_on_ramps_that_was_stopped_goes_on_to_the_same_tables(tmp_path, monkeypatch):
    from pipelines.capture import capture as capturing
    from schemas.errors import OperatorNeeded

    recipe = ramp_recipe(tmp_path)
    whole = command(["run", recipe, "--archive", str(tmp_path / "whole"), "--direct"])
    assert whole.returncode in {0, 1}, whole.stderr
    taken, measure = [], capturing.CaptureRun.measure_and_store

    def stops(self, step):
        if len(taken) == 30:
            raise OperatorNeeded("a stop in the middle of a ramp")
        taken.append(step)
        measure(self, step)

    with monkeypatch.context() as patch:
        patch.setattr(capturing.CaptureRun, "measure_and_store", stops)
        stopped = command(["run", recipe, "--archive", str(tmp_path / "stopped"), "--direct"])
        assert stopped.returncode == 3
    again = command(["run", recipe, "--archive", str(tmp_path / "stopped"), "--direct"])
    assert again.returncode in {0, 1}, again.stderr
    first, second = coefficients(tmp_path / "whole")[1], coefficients(tmp_path / "stopped")[1]
    assert first.equals(second)


@pytest.mark.slow
def test_the_command_writes_a_recipe_on_ramps_with_its_bound(tmp_path):
    target = tmp_path / "quick.toml"
    page = tmp_path / "quick.html"
    words = ["plan", "optimise", "--effects", ",".join(THERMAL), "--device", "analogue", "-o", str(target)]
    for setting in ("ramp=yes", "factor=3", "verification=1"):
        words += ["--set", setting]
    done = command([*words, "--output", str(page), "--json"])
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["ramp"] is True
    assert 0.0 < document["bound"]["share"] <= document["share"] < 0.35
    recipe = load_recipe(str(target))
    assert {soak.settled for soak in recipe.soaks} == {False}
    # errors three times as large must not shorten the range over which the model holds
    heat = planned_state(recipe, load_station()).temperature
    assert short_of(heat, LEVELS) == 0.0
    assert "<svg" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_quick_recipe_takes_two_thirds_of_the_main_jobs_time_and_its_model_is_adequate(tmp_path):
    minutes = {
        name: json.loads(command(["plan", name, "--json"]).stdout)["minutes"]["total"]
        for name in ("quick", "production")
    }
    assert minutes["quick"] < 0.65 * minutes["production"]
    done = command(["run", "quick", "--archive", str(tmp_path / "archive"), "--direct", "--json"])
    verdict = json.loads(done.stdout)["adequacy"]
    assert (verdict["adequate"], verdict["named"]) == (True, False)
