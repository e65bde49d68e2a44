"""Soaks with waits, ramps, and dwells while the devices still follow the chamber: time left, plans and tables."""

import dataclasses
import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from capture_double import recipe_file
from in_process import command
from inquiries import job_of
from small_station import MemorySink, captured, lot_of, short_recipe, station_of

from inertial.planning.sequences import SequenceStep as Wanted
from inertial.planning.sequences import timeline
from pipelines.archive import Archive
from pipelines.capture.capture import capture
from pipelines.capture.time_left import Remaining
from pipelines.inquiry.followup import circumstances, state_after, station_minutes
from pipelines.jobs.recipes import load_recipe
from pipelines.planning.requirement import ramp_orders
from pipelines.planning.timed_design import followed_along, short_of
from pipelines.schedule.planned_state import planned_state
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import StationPose, minutes
from schemas.poses import Pose, SoakPart
from schemas.recipe import Recipe
from schemas.station import load_station
from stations.opening import open_station

LEFT = re.compile(r"(?:(\d+) h )?(?:(\d+) min|(\d+) s) of station time left(?:, about [^,]+ here)?$")


def told_and_true(recipe, config, units=1):
    """Pairs (station time, seconds left as told), when the run was over, and the seconds of its soaks."""
    told, soaks = [], []
    with open_station(config, lot_of(units)) as station:
        inner = station.soak

        def progress(_done, _total, note):
            match = LEFT.search(note)
            if match:
                hours, minutes, seconds = (int(part or 0) for part in match.groups())
                told.append((station.clock.now(), 3600.0 * hours + 60.0 * minutes + seconds, note))

        def soak(*given):
            soaks.append(inner(*given))
            return soaks[-1]

        watched = dataclasses.replace(station)
        object.__setattr__(watched, "soak", soak)
        capture(watched, recipe, lot_of(units), MemorySink(), progress=progress)
        return told, station.clock.now(), sum(soaks)


def planned_as_taken(recipe, config, end, soaks):
    """Whether the planned minutes of soaks, and of the rest, are those that the station took."""
    planned = minutes(steps(recipe), config, recipe)
    assert planned.soaks == pytest.approx(soaks / 60.0, rel=0.1)
    assert planned.total - planned.soaks == pytest.approx((end - soaks) / 60.0, rel=0.1)


def after_first_soak(told):
    first = next(k for k, (_, _, note) in enumerate(told) if "soak" not in note)
    return told[first:]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("temperatures", "changes"),
    [
        ((25.0, 60.0, -10.0), {}),
        pytest.param((50.0, 10.0), {}, marks=pytest.mark.slow),
        pytest.param((60.0, -20.0, 10.0, 40.0), {}, marks=pytest.mark.slow),
        pytest.param((40.0, 0.0, 60.0), {"slot_lag_s": [250.0, 400.0]}, marks=pytest.mark.slow),
    ],
)
def test_the_time_that_is_left_is_right_within_a_tenth_after_the_first_soak(temperatures, changes):
    recipe, config = short_recipe(poses=6, static_s=300.0, temperatures=temperatures), station_of(**changes)
    told, end, soaks = told_and_true(recipe, config, units=2)
    if temperatures == (25.0, 60.0, -10.0):
        planned_as_taken(recipe, config, end, soaks)
    judged = [(now, left, end - now) for now, left, _ in after_first_soak(told) if end - now > 600.0]
    assert len(judged) > 50
    worst = max(abs(left - true) / true for _, left, true in judged)
    assert worst < 0.10
    soaking = [left for _, left, note in told if f"soak at {temperatures[1]:g}" in note]
    assert len(soaking) > 50
    assert all(b <= a for a, b in itertools.pairwise(soaking))  # it never runs up within a soak


@pytest.mark.slow
def test_a_station_that_is_slower_than_its_file_says_teaches_by_its_first_soak_and_records():
    config = station_of()
    wrong = config.model_copy(update={"pace": config.pace.model_copy(update={"ramp_K_per_min": 6.0})})
    recipe = short_recipe(poses=6).model_copy(update={"temperatures_C": [60.0, -10.0, 40.0], "soak_min_s": 900.0})
    told, end, _ = told_and_true(recipe, wrong)
    judged = [(left, end - now) for now, left, _ in after_first_soak(told) if end - now > 600.0]
    first_error = abs(told[0][1] - end) / end
    assert first_error > 0.12  # before the first soak nobody can know
    assert max(abs(left - true) / true for left, true in judged) < 0.10


def test_a_resumed_run_counts_what_is_left_far_moves_for_more_and_the_wall_clock_in_proportion(
    monkeypatch: pytest.MonkeyPatch,
):
    recipe, far, clock = short_recipe(poses=4), short_recipe(poses=1), [100.0]
    monkeypatch.setattr("pipelines.capture.time_left.time.monotonic", lambda: clock[0])
    plan = steps(recipe)
    left = Remaining(plan, station_of(), recipe)
    first, last = (left.seconds(plan[k], 0.0) for k in (0, -1))
    assert first > 900.0
    assert last < 30.0
    away = far.model_copy(update={"poses": [Pose(name="far", outer_deg=180.0, inner_deg=0.0)]})
    seconds = [Remaining(steps(r), station_of(), r).seconds(steps(r)[0], 0.0) for r in (far, away)]
    assert seconds[1] > seconds[0]

    assert left.wall_seconds(plan[0]) is None
    clock[0] += 6.0
    for step in plan[:2]:
        left.add_record(step, 12.0)
    done, rest = (sum(left._record[step.record] for step in part) for part in (plan[:2], plan[2:]))
    assert left.wall_seconds(plan[2]) == pytest.approx(6.0 * rest / done)


def test_parts_of_the_planned_time_are_told_apart_with_the_pace_of_the_file_and_waits_are_as_many_as_poses():
    recipe = short_recipe(2, static_s=120.0)
    first = steps(recipe)[0]
    standing = StationPose(outer=0.0, inner=0.0, air=25.0, device=25.0, soak=first.soak)
    soaked = minutes([first], station_of(), recipe, standing)  # it only moves and dwells
    assert soaked.soaks == 0.0
    assert soaked.dwells > 0.0
    recipe = short_recipe(1, temperatures=(60.0,))
    config = station_of().model_copy(update={"simulation": None})  # hardware takes its pace from the station's file
    fast = config.model_copy(update={"pace": config.pace.model_copy(update={"ramp_K_per_min": 10.0, "lag_s": 60.0})})
    assert minutes(steps(recipe), fast, recipe).soaks < minutes(steps(recipe), config, recipe).soaks
    soak = {"temperature_C": 25.0, "poses": [1], "verification": []}
    for key, said in (("waits_s", "2 waits"), ("off_s", "2 times without power")):
        with pytest.raises(ValueError, match=f"soak 1 has {said} for 1 poses"):
            Recipe.model_validate({**short_recipe(1).model_dump(), "soaks": [{**soak, key: [1.0, 2.0]}]})


def ordered_recipe():
    """A recipe of soaks with waits of their own, dwells on the way to a temperature, and a pause without power."""
    recipe = short_recipe(4)
    soaks = [
        SoakPart(temperature_C=25.0, poses=[1, 2, 3, 4], waits_s=[2.0, 60.0, 300.0, 2.0]),
        SoakPart(temperature_C=60.0, poses=[1, 2, 3, 4, 1, 2], waits_s=[30.0] * 6, settled=False),
        SoakPart(temperature_C=25.0, poses=[1, 2], verification=[], off_s=[0.0, 240.0]),
    ]
    return recipe.model_copy(update={"soaks": soaks, "temperatures_C": [s.temperature_C for s in soaks]})


SMALL_STEPS = short_recipe(4, static_s=60.0, temperatures=(10.0, 15.0, 20.0, 15.0, 10.0))


@pytest.mark.parametrize(
    "recipe", [pytest.param(SMALL_STEPS, marks=pytest.mark.slow), ordered_recipe()], ids=["steps", "waits"]
)
def test_small_steps_waits_readings_on_the_way_and_pauses_without_power_take_the_minutes_that_are_planned(recipe):
    planned_as_taken(recipe, station_of(), *told_and_true(recipe, station_of())[1:])


@pytest.mark.slow
def test_devices_read_on_the_way_are_planned_at_the_temperatures_they_have_there():
    recipe, config = ordered_recipe(), station_of(slot_gradient_K=0.0, slot_lag_s=(200.0, 200.0))
    sink = captured(recipe, lot_of(1), config)
    plan = [step for step in steps(recipe) if step.kind == "dwell"]
    really = [float(sink.records[step.record][1]["unit_C"].iloc[0]) for step in plan]
    state = planned_state(recipe, config, history=True)
    assert not plan[4].settled
    assert state.temperature == pytest.approx(really, abs=0.6)
    assert state.temperature[4] < state.temperature[9] < 50.0
    assert state.since_move[2] == pytest.approx(301.0, rel=0.1)
    assert state.since_power[11] < state.since_power[10]
    assert state.history is not None
    assert np.interp(state.time[4:10], state.history.time, state.history.temperature) == pytest.approx(
        state.temperature[4:10], abs=0.5
    )


def test_follow_ups_and_plans_take_the_same_time_and_the_same_temperatures(tmp_path):
    """The same steps, as the science proposes them and as the station is asked for them: soaked, on the way, after a pause."""
    job = job_of(tmp_path)
    place = state_after(job)
    wanted = [
        Wanted(0.3, -1.0, 25.0, wait=5.0), Wanted(2.0, 2.5, 25.0, wait=5.0, off=90.0),
        Wanted(1.0, 0.2, 55.0), Wanted(-1.5, 0.2, 55.0),
        Wanted(0.0, 3.0, -5.0, soaked=False), Wanted(1.2, -2.0, -5.0, soaked=False),
    ]  # fmt: skip
    pace = circumstances(job, job, 100.0).pace
    ran = timeline(wanted, pace, pace.start, place.device)
    assert ran.end == pytest.approx(60.0 * station_minutes(wanted, job, place))
    for count in range(1, len(wanted)):
        assert ran.time[count - 1] + 0.5 * pace.dwell_s == pytest.approx(
            60.0 * station_minutes(wanted[:count], job, place)
        )
    # the last two are read on the way: against the first-order lag, integrated in small steps from the soak at 55 °C on
    air, device, now = 55.0, float(ran.device[3]), float(ran.time[3]) + 0.5 * pace.dwell_s
    temperatures = {}
    while now < ran.end:
        air += float(np.clip(-5.0 - air, -pace.ramp * 0.01, pace.ramp * 0.01))
        device += (air - device) * 0.01 / pace.lag
        now += 0.01
        temperatures |= {k: (air, device) for k in (4, 5) if k not in temperatures and now >= ran.time[k]}
    for k in (4, 5):
        assert (ran.air[k], ran.device[k]) == pytest.approx(temperatures[k], abs=0.02)


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
