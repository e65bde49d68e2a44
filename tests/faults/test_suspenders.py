"""What spoils data pauses a run: it goes back to its checkpoint, measures again, and the journal says why."""

import pandas as pd
import pytest
from long_suites import mostly_slow
from small_station import QUIET, MemorySink, lot_of, quiet_progress, short_recipe, station_of

from pipelines.capture.capture import capture
from schemas.errors import OperatorNeeded
from schemas.event import MemoryLog
from stations.opening import make_plant, open_station, serve_plant

RECIPE = short_recipe(poses=3)
DURING = 912.0  # the second record of RECIPE is being taken then


def run(*faults, config=None, lot=None, sink=None, events=None, recipe=RECIPE, **suspenders):
    config = config or station_of(faults=list(faults), preset_overrides=QUIET)
    rules = config.suspenders.model_copy(update=suspenders)
    config = config.model_copy(update={"suspenders": rules})
    lot = lot or lot_of()
    sink, events = sink or MemorySink(), events or MemoryLog()
    with open_station(config, lot, resume=sink.last_state()) as station:
        capture(station, recipe, lot, sink, progress=quiet_progress, events=events)
    return sink, events


def kinds(events):
    return [event.kind for event in events.recorded() if event.kind not in {"reference", "soak"}]


def means(sink):
    return sink.all(0).groupby(["unit", "record"])[["x", "y", "z"]].mean()


@pytest.fixture(scope="module")
def undisturbed():
    return run()


DISTURBANCES = {
    "door": {"kind": "door", "at_s": DURING, "for_s": 60.0},
    "vibration": {"kind": "vibration", "at_s": DURING, "for_s": 60.0},
    "supply": {"kind": "supply_sag", "at_s": DURING, "for_s": 60.0, "device": "reader"},
}


@pytest.mark.parametrize("condition", mostly_slow(DISTURBANCES, "vibration"))
def test_a_condition_that_passes_costs_time_and_no_data(condition, undisturbed):
    sink, events = run(DISTURBANCES[condition])
    assert kinds(events) == ["spoilt", "resumed"]
    spoilt, resumed = (next(e for e in events.recorded() if e.kind == kind) for kind in ("spoilt", "resumed"))
    assert condition in spoilt.reason
    assert spoilt.record == resumed.record == 1
    assert resumed.figures["paused_s"] >= 60.0
    assert sorted(sink.records) == sorted(undisturbed[0].records)
    assert (sink.all(1)["status"] == "ok").all()
    begins = sink.all(1).drop_duplicates("record").set_index("record")["start_s"]
    assert begins[1] > DURING + 60.0 + 30.0  # gone for a while, and the soak made sure of
    far = (means(sink) - means(undisturbed[0])).abs().to_numpy().max()
    assert far < 20.0  # LSB of 1/256000 g: the table does not come to rest twice in the same place


@pytest.mark.slow
def test_a_chamber_that_loses_its_power_for_a_while_is_settled_anew():
    recipe = short_recipe(poses=3, temperatures=(60.0,))
    whole, _ = run(recipe=recipe)
    begins = whole.all(1).drop_duplicates("record").set_index("record")["start_s"]
    far = float(begins[1]) - 2.0
    sink, events = run(
        {"kind": "chamber_power", "at_s": far, "for_s": 900.0}, recipe=recipe.model_copy(update={"dwell_s": 60.0})
    )
    assert "spoilt" in kinds(events)
    assert any("is needed" in event.reason for event in events.recorded() if event.kind == "spoilt")
    readings = sink.all(1)
    assert (abs(readings["unit_C"] - 60.0) <= 1.0).all()
    assert (readings["status"] == "ok").all()
    assert sum(event.kind == "soak" for event in events.recorded()) >= 2


def test_a_door_that_stays_open_ends_the_run_with_its_finished_records():
    sink, events = MemorySink(), MemoryLog()
    words = r"paused for 3\d\d s: the chamber's door is open, .*; correct it .* no measured record is lost"
    with pytest.raises(OperatorNeeded, match=words) as end:
        run({"kind": "door", "at_s": DURING}, sink=sink, events=events, limit_s=300.0)
    assert end.value.exit_status == 3
    assert end.value.condition.endswith("correct it")  # who is asked at the station gives no command
    assert sorted(sink.records) == [0]
    assert kinds(events) == ["spoilt", "stopped"]
    assert events.recorded()[-1].action == "outer axis stopped; inner axis stopped; sampling stopped; chamber to 25 °C"


def test_a_run_that_the_door_has_ended_goes_on_when_it_is_closed_and_the_command_given_again(undisturbed):
    fault = {"kind": "door", "at_s": DURING, "for_s": 1200.0}
    sink, events = MemorySink(), MemoryLog()
    with pytest.raises(OperatorNeeded, match="door"):
        run(fault, sink=sink, events=events, limit_s=60.0)
    first = sink.all(1)
    run(fault, sink=sink, events=events, limit_s=3600.0)
    pd.testing.assert_frame_equal(sink.all(1).query("record == 0"), first, check_exact=True)
    assert sorted(sink.records) == sorted(undisturbed[0].records)


def test_the_emergency_stop_waits_for_nothing_and_leaves_the_station_safe():
    config, lot, events = station_of(faults=[{"kind": "emergency_stop", "at_s": DURING}]), lot_of(), MemoryLog()
    plant = make_plant(config, lot)
    with serve_plant(config, lot, plant) as station, pytest.raises(OperatorNeeded, match="emergency stop is pressed"):
        capture(station, RECIPE, lot, MemorySink(), progress=quiet_progress, events=events)
    assert events.recorded()[-1].kind == "emergency_stop"
    assert not plant.sampler.running
    assert plant.fixture.chamber.set_point == 25.0
    assert plant.now < DURING + 15.0


def test_a_dwell_spoilt_again_and_again_is_given_up_and_a_moment_of_silence_is_not():
    shocks = [{"kind": "vibration", "at_s": at, "for_s": 5.0} for at in (911.0, *range(1020, 1060, 6))]
    with pytest.raises(OperatorNeeded, match=r"record \d+ \(pose p\d\) spoilt 2 times: vibration"):
        run(*shocks, attempts=2, clear_s=0.0)
    # a device of the station that is silent for a moment costs no run
    sink, events = run({"kind": "silent", "at_s": DURING, "for_s": 8.0, "device": "chamber"})
    assert (len(sink.records), kinds(events)) == (4, ["suspended"])


def test_soaks_tell_how_far_they_went_beyond():
    _, events = run(recipe=short_recipe(poses=1, temperatures=(25.0, 60.0)))
    soaks = [event.figures for event in events.recorded() if event.kind == "soak"]
    assert [soak["target_C"] for soak in soaks] == [25.0, 60.0]
    assert 0.2 < soaks[1]["air_overshoot_K"] < 2.0
    assert 0.0 <= soaks[1]["device_overshoot_K"] < soaks[1]["air_overshoot_K"]


@pytest.mark.slow
@pytest.mark.parametrize("records", mostly_slow([1, 2], 1))
def test_a_run_killed_around_a_pause_goes_on_bit_for_bit(records):
    fault = DISTURBANCES["door"]
    whole, reasons = run(fault)
    sink, events = MemorySink(die_after=records), MemoryLog()
    with pytest.raises(KeyboardInterrupt):
        run(fault, sink=sink, events=events)
    sink.die_after = 10**6
    run(fault, sink=sink, events=events)
    assert sink.state == whole.state
    for part in range(3):
        pd.testing.assert_frame_equal(sink.all(part), whole.all(part), check_exact=True)
    assert events.recorded() == reasons.recorded()
