"""The devices switched off and on by the station: physics of the plant, the register, the capture, and what the dwells say."""

import math

import inquiries
import numpy as np
import pytest
from small_station import QUIET, MemorySink, captured, lot_of, plant_of, quiet_progress, short_recipe, station_of, write

from inertial.planning.sequences import SequenceStep
from inertial.power import switched
from pipelines.archive import Archive
from pipelines.capture.capture import capture
from pipelines.capture.supervision import Power, Supervisor
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.inquiry.followup import follow_up
from pipelines.inquiry.inquiry import FOLLOW_UP, FollowUp, begin
from pipelines.schedule.steps import steps
from schemas.errors import OperatorNeeded, StationRefused
from schemas.event import MemoryLog
from schemas.poses import SoakPart
from schemas.progress import silent
from schemas.recipe import Recipe
from stations.opening import make_plant, open_station, serve_plant
from stations.plant.hidden.device import StressRelaxation, WarmUp

READER = 10
OFF_S = 600.0
LSB_PER_G = 256000.0
COLD = {**QUIET, "bias_stability_ug": 0.0}


def recipe_with_power_off(off: tuple[float, ...] = (0.0, OFF_S, 0.0)) -> Recipe:
    plain = short_recipe(poses=1)
    soak = SoakPart(temperature_C=25.0, poses=[1] * len(off), verification=[], off_s=list(off))
    changed = {"soaks": [soak.model_dump()], "verification": [], "soak_min_s": 60.0, "allow_short_soak": True}
    return Recipe.model_validate({**plain.model_dump(), **changed})


def run(sink=None, events=None, recipe=None, hidden=(), **simulation):
    config, events = station_of(**{"preset_overrides": COLD, **simulation}), events or MemoryLog()
    recipe = recipe or recipe_with_power_off()
    return captured(recipe, lot_of(2), config, sink, events=events, hidden=hidden), events


def biases(sink):
    """Mean output of the first unit by record, (records, 3), g."""
    samples = sink.all(0).query("unit == 'U000'")
    return samples.groupby("record")[["x", "y", "z"]].mean().to_numpy() / LSB_PER_G


@pytest.mark.slow
def test_the_time_with_power_begins_again_and_the_readings_say_for_how_long_there_was_none():
    sink, events = run()
    readings = sink.all(1).drop_duplicates("record").set_index("record")
    assert readings["power_off_s"].tolist() == [0.0, pytest.approx(OFF_S, abs=1.0), 0.0]
    assert readings["since_power_s"][1] < 60.0 < readings["since_power_s"][0]
    assert readings["since_power_s"][2] > readings["since_power_s"][1]
    assert readings["start_s"][1] - readings["start_s"][0] > OFF_S
    told = [(e.record, e.action) for e in events.recorded() if e.kind == "power"]
    assert told == [(1, "devices off"), (1, "devices on again")]
    nothing, _ = run(recipe=recipe_with_power_off((0.0, 0.0)))
    assert "power_off_s" not in nothing.all(1).columns  # a run that switches nothing says nothing of it


def test_warm_up_begins_where_the_device_has_cooled_to_and_stress_goes_on_without_power():
    size, tau = 4e-3, 500.0
    sink, _ = run(hidden=[WarmUp(size=size, tau=tau)])
    bias = biases(sink)[:, 0]
    middle = sink.all(1).drop_duplicates("record")["since_power_s"].to_numpy()
    # warmth by a differential equation, stepped, not the closed form
    warmth, at, seconds = 0.0, [], 0.01
    stop = float(middle[0] + 1.0)
    for target, until in ((1.0, stop), (0.0, OFF_S), (1.0, middle[1])):
        for _ in range(round(until / seconds)):
            warmth += (target - warmth) * seconds / tau
        at.append(warmth)
    expected = -size * (at[2] - (1.0 - math.exp(-middle[0] / tau)))
    assert bias[1] - bias[0] == pytest.approx(expected, abs=3e-5)
    sink, _ = run(hidden=[StressRelaxation(size=2e-3, shortest=100.0)])  # which goes on letting go without power
    first, second = sink.all(1).drop_duplicates("record")["start_s"].to_numpy()[:2] + 1.0
    bias, expected = biases(sink)[:, 0], 2e-3 * (math.log1p(second / 100.0) - math.log1p(first / 100.0))
    assert bias[1] - bias[0] == pytest.approx(expected, rel=0.2)


@pytest.mark.slow
def test_the_bias_after_a_power_on_differs_by_what_the_preset_says():
    repeats = 24
    overrides = {**QUIET, "bias_stability_ug": 2000.0}
    sink, _ = run(recipe=recipe_with_power_off((0.0, *[5.0] * repeats)), preset_overrides=overrides)
    bias = biases(sink)
    jumps = bias[1:] - bias[0]
    assert np.std(jumps) == pytest.approx(2e-3, rel=0.25)
    plain, _ = run()
    assert np.ptp(biases(plain), axis=0) == pytest.approx(0.0, abs=4e-5)


def test_without_power_the_devices_tell_nothing_and_the_same_order_twice_is_one():
    plant = plant_of(station_of(preset_overrides={**QUIET, "bias_stability_ug": 500.0}))
    plant.advance(5_000_000)
    for _ in range(2):
        write(plant, READER, "power", "off")
        plant.advance(1_000_000)
    assert plant.since_power == 0.0
    assert max(plant.supply_reading()) == 0.0
    assert all(math.isnan(plant.temperature_reading()[slot]) for slot in plant.slots)
    write(plant, READER, "power", "on")
    bias = plant.physics.devices._bias.copy()
    plant.advance(7_000_000)
    write(plant, READER, "power", "on")
    assert plant.since_power == pytest.approx(7.0)
    assert np.array_equal(plant.physics.devices._bias, bias)


def test_a_run_killed_after_a_power_order_comes_to_the_same_records():
    whole, _ = run()
    dying, events = MemorySink(die_after=1), MemoryLog()
    with pytest.raises(KeyboardInterrupt):
        run(sink=dying, events=events)
    dying.die_after = 10**6
    run(sink=dying, events=events)
    for part in (0, 1):
        assert whole.all(part).equals(dying.all(part))


def test_devices_that_a_killed_run_left_without_power_are_switched_on_and_their_record_knows():
    config, lot = station_of(preset_overrides=COLD), lot_of(2)
    plant, events, step = make_plant(config, lot), MemoryLog(), steps(recipe_with_power_off())[1]
    with serve_plant(config, lot, plant) as station:
        guard = Supervisor(station, events)
        guard.note("power", step.record, "the recipe asks for it", "devices off")
        station.reader.switch("off")  # and the process is gone
        plant.advance(90_000_000)
        again = Power(station, Supervisor(station, events), ordered=True)
        again.require_on()
        assert station.reader.powered()
        assert again.off_before(step) == pytest.approx(90.0, abs=1.0)
        before = plant.now
        again.cycle(step)
        assert plant.now == before  # not twice for one record


def test_the_emergency_stop_ends_the_wait_with_power_and_a_reader_that_cannot_switch_refuses_at_once(monkeypatch):
    config, lot = station_of(preset_overrides=COLD, faults=[{"kind": "emergency_stop", "at_s": 300.0}]), lot_of(2)
    plant, events = make_plant(config, lot), MemoryLog()
    recipe = recipe_with_power_off((0.0, 3000.0))
    with serve_plant(config, lot, plant) as station, pytest.raises(OperatorNeeded, match="emergency stop"):
        capture(station, recipe, lot, MemorySink(), progress=quiet_progress, events=events)
    assert plant.powered
    assert plant.now < 330.0
    with open_station(station_of(preset_overrides=COLD), lot) as station:
        registers = station.reader._registers
        monkeypatch.setattr(registers, "has", lambda name: name != "power")
        with pytest.raises(StationRefused, match="no register 'power', one is needed"):
            capture(station, recipe_with_power_off(), lot, MemorySink(), progress=quiet_progress)
        assert station.clock.now() < 1.0


UP, DOWN = (0.0, 0.0), (math.pi, 0.0)


@pytest.mark.slow
def test_warm_up_is_named_by_what_follows_a_power_on_whatever_the_bias_has_come_back_to(tmp_path):
    archive = Archive(tmp_path / "archive")
    job = inquiries.job_of(tmp_path, kind="warm_up", size=400e-6, tau=900.0)
    runner = Runner(job, archive, silent)
    for name in ORDER:
        runner.stage(name)
    inquiry = begin(archive, job, runner.run, (), None)
    alternating = [SequenceStep(*(UP, DOWN)[k % 2], 25.0, wait=8.0) for k in range(24)]
    wanted = [SequenceStep(*UP, 25.0), SequenceStep(*DOWN, 25.0), SequenceStep(*UP, 25.0, off=1200.0), *alternating]
    move = FollowUp(follow_up(wanted, job, job, inquiry.lineage.ids, "why"), (), ("why",), 30.0)
    follower = inquiry.runner(move, silent)
    for name in FOLLOW_UP:
        follower.stage(name)
    inquiry.add_run(move, follower.run)
    finding = inquiry.diagnose()

    first = runner.run.table("dwells")["dwell"].nunique()
    assert switched(finding.state) == [first + 2]
    assert finding.state.power_off.max() == pytest.approx(1200.0, abs=2.0)
    assert [t.effect.id for t in finding.diagnosis.base.terms][-1] == "turn_on_bias"
    assert ["warm_up"] in [group["effects"] for group in finding.document["classes"]]

    dwells = follower.run.table("dwells")
    up = dwells[(dwells["unit"] == "A1") & (np.abs(dwells["force_z"] - 1.0) < 1e-3)].sort_values("dwell")
    after = up[up["since_power_s"] < 600.0]["out_z"].to_numpy() / 256000.0
    # the device lacks 1 − (1 − e^(−u/τ))·e^(−off/τ) of its warmth, and makes good for a part of it while it is looked at
    on = float(runner.run.table("dwells")["since_power_s"].max())
    cold = 1.0 - (1.0 - math.exp(-on / 900.0)) * math.exp(-1200.0 / 900.0)
    seen = np.exp(-up[up["since_power_s"] < 600.0]["since_power_s"].to_numpy() / 900.0)
    assert after[0] - after[-1] == pytest.approx(400e-6 * cold * (seen[0] - seen[-1]), abs=25e-6)
