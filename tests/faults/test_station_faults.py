"""Trouble at the station and on its wires: reported by name, never passed over, and the rest goes on."""

import socket
import threading
from contextlib import contextmanager
from types import SimpleNamespace

import pandas as pd
import pytest
from each import each
from long_suites import mostly_slow
from plant_wires import tcp_link
from root_process import ROOT
from small_server import answering
from small_station import QUIET, MemorySink, captured, lot_of, plant_of, quiet_progress, short_recipe, station_of

from pipelines.capture.capture import capture
from schemas.errors import (
    ArchiveUnusable,
    DataRejected,
    LinkLost,
    OperatorNeeded,
    RecipeInvalid,
    StationRefused,
    StationTimeout,
    WrongUse,
)
from schemas.event import MemoryLog
from schemas.fault import FaultOrder
from schemas.poses import Pose
from schemas.station import load_station
from stations.links import lines
from stations.links.lines import LineLink
from stations.opening import open_station, serve_plant
from stations.plant.faults import proxy, wire
from stations.plant.faults.proxy import HEADER, WireAction
from stations.plant.server import PlantServer
from stations.serving import serve

SERVING = {"host": "127.0.0.1", "speed": 1.0, "stop": threading.Event(), "ready": print}
SIMULATED = (ROOT / "stations" / "simulated.toml").read_text(encoding="utf-8")


def test_a_capture_that_holds_dwells_of_a_worn_table_is_not_gone_on_with():
    """The table is mended, the same command given again: dwells that were stored before the play was seen would stay in it."""
    sink, events = MemorySink(), MemoryLog()
    poses = [Pose(name=f"p{i}", outer_deg=(-1) ** i * (20.0 + 20.0 * i), inner_deg=25.0 * i) for i in range(8)]
    recipe = short_recipe().model_copy(update={"poses": poses})
    worn = station_of(faults=[{"kind": "backlash", "device": "outer", "at_s": 0.0, "figures": {"play_deg": 2.0}}])
    for config in (worn, station_of()):
        with (
            open_station(config, lot_of()) as station,
            pytest.raises(OperatorNeeded, match=r"table: the outputs of all units turn .* measure the lot anew"),
        ):
            capture(station, recipe, lot_of(), sink, progress=quiet_progress, events=events)
        assert 0 < len(sink.finished()) < 8


def test_a_lot_of_which_nobody_answers_is_refused():
    with pytest.raises(OperatorNeeded, match="no unit"):
        captured(short_recipe(), lot_of(1), station_of(faults=[{"kind": "silent", "serial": "U000"}]))


def test_samples_that_the_ring_has_lost_are_flagged_and_not_made_up():
    lot = lot_of(1)
    with open_station(load_station(), lot) as station:
        station.reader.start(1000.0)
        station.clock.sleep(20.0)
        station.reader.stop()
        samples = station.reader.slots[0].take()
    assert samples.overflow
    assert (samples.first, len(samples.outputs)) == (8000, 12000)


def test_a_server_that_is_gone_is_a_lost_link_with_its_address():
    plant = plant_of(lot=lot_of(1))
    with PlantServer(plant) as server:
        port = server.port
        link = tcp_link(server.host, port, timeout_s=1.0, read_attempts=2)
        assert link.read(10, 0, 1, "slots") == [8]
        with pytest.raises(StationRefused, match="free port"):  # its port is taken
            PlantServer(plant_of(lot=lot_of(1)), port=port).__enter__()
        told = rf":\d+ .*, free ports {port - 1} \(registers\) to \d+ \(one for each text protocol\) are needed"
        with pytest.raises(StationRefused, match=told):
            serve(load_station(), lot_of(1), **SERVING, port=port - 1)
    with pytest.raises((LinkLost, StationTimeout), match=f"127.0.0.1:{port}"):
        link.read(10, 0, 1, "slots")
    link.close()


def test_a_state_of_another_lot_is_refused():
    sink = captured(short_recipe())
    with pytest.raises(DataRejected, match="another station or lot"):
        captured(short_recipe(), lot_of(seed=6), sink=sink)
    sink.state = b"torn"
    with pytest.raises(ArchiveUnusable, match="not readable"):
        captured(short_recipe(), sink=sink)


MODBUS = SIMULATED.partition("[uncertainty")[0].replace('kind = "simulated"', 'kind = "modbus"')
SLIPS = [
    ("name = 'x'\nkind = 'simulated'\n[limts]\n", "limits"),
    ("name = 'x'\nkind =", "not valid TOML"),
    (SIMULATED.replace("device_id = 2", "device_id = 1"), "one drive would get the orders of both axes"),
    (SIMULATED.replace("seed = 1", "slot_lag_s = [200.0, 90.0]"), "'simulation.slot_lag_s': 200 is above 90"),
    (MODBUS, r"devices\.outer\.host"),
]


@each(SLIPS, lambda row: row[1])
def test_a_station_file_with_a_typo_or_hardware_without_an_address_is_refused_and_hardware_not_served(row, tmp_path):
    text, needed = row
    (tmp_path / "station.toml").write_text(text, encoding="utf-8")
    with pytest.raises(RecipeInvalid, match=needed):
        load_station(tmp_path / "station.toml")
    with pytest.raises(WrongUse, match="a simulated station is needed"):
        serve(load_station().model_copy(update={"kind": "modbus"}), lot_of(), **SERVING, port=0)


# -- samples on their way: lost answers, changed bytes, counters that contradict each other -------------------------------

WRITE, READ = 16, 3
SLOT_1 = 12


def through(monkeypatch: pytest.MonkeyPatch, script) -> tuple[MemorySink, MemoryLog]:
    """What a capture gives whose frames go through a script."""
    config, sink, events = load_station(), MemorySink(), MemoryLog()
    config = config.model_copy(update={"link": config.link.model_copy(update={"timeout_s": 0.6})})
    with monkeypatch.context() as patch:
        if script:
            patch.setattr(wire, "script_of", lambda _world, _faults: script)
        with serve_plant(config, lot_of(), plant_of(config)) as station:
            capture(station, short_recipe(), lot_of(), sink, progress=quiet_progress, events=events)
    return sink, events


@pytest.mark.slow
def test_a_slot_whose_answer_to_what_was_taken_is_lost_is_asked_and_keeps_its_unit(monkeypatch) -> None:
    lost: list[bytes] = []

    def script(way, frame):
        if way == "reply" and frame[HEADER - 1] == SLOT_1 and frame[HEADER] == WRITE and len(lost) < 3:
            lost.append(frame)
            return WireAction("drop")
        return None

    sink, _ = through(monkeypatch, script)
    assert len(lost) == 3
    assert (sink.all(1)["status"] == "ok").all()
    assert (sink.all(1)["n"] == 200).all()
    undisturbed, _ = through(monkeypatch, None)
    assert sink.all(0).equals(undisturbed.all(0)), "nothing is taken twice, nothing is missing"


CHANGED = [(9, 0x40), (9 + 8 * 3 + 2, 0x04), (9 + 8 * 10 + 5, 0x40), (9 + 8 * 5 + 7, 0x01)]


@pytest.mark.parametrize(("byte", "bit"), mostly_slow(CHANGED, CHANGED[0], CHANGED[-1]))
def test_samples_that_change_on_their_way_are_measured_again(monkeypatch, byte: int, bit: int) -> None:
    changed: list[bytes] = []

    def script(way, frame):
        samples = way == "reply" and frame[HEADER - 1] == SLOT_1 and frame[HEADER] == READ and len(frame) > 240
        return WireAction("duplicate") if samples and not changed else None

    def spoilt(frame, _action, _of):
        """One bit of the frame is another, in place of its duplicate."""
        changed.append(frame)
        other = bytearray(frame)
        other[byte] ^= bit
        return [bytes(other)]

    monkeypatch.setattr(proxy, "replaced", spoilt)
    sink, events = through(monkeypatch, script)
    assert changed
    [reason] = [event.reason for event in events.recorded() if event.kind == "spoilt"]
    assert "slot 1: sample" in reason
    assert (sink.all(1)["status"] == "ok").all()


def test_a_reader_that_does_not_start_is_refused() -> None:
    plant = plant_of(lot=lot_of(1))
    plant.inject(FaultOrder(kind="exceptions_off", device="reader"))
    with (
        serve_plant(load_station(), lot_of(1), plant) as station,
        pytest.raises(StationRefused, match="sampling is stopped"),
    ):
        station.reader.start(100.0)


def test_a_slot_that_forgets_what_was_taken_is_refused() -> None:
    plant = plant_of(lot=lot_of(1))
    with serve_plant(load_station(), lot_of(1), plant) as station:
        slot = station.reader.slots[0]
        station.reader.start(100.0)
        station.clock.sleep(1.0)
        assert len(slot.take().outputs) == 100
        plant.sampler.tail[0] = 50
        station.clock.sleep(1.0)
        with pytest.raises(StationRefused, match="reports 50 of 200 samples as read, 100 is needed"):
            slot.take()


# -- devices that are spoken to in lines: slow, silent, saying too much, hanging up ---------------------------------------


PATIENCE_S = 10.0
"""For answers that come; a busy machine takes its time."""
SILENCE_S = 1.0
"""For answers of which one does not come and the next does."""


@contextmanager
def linked(*answers: bytes | None, attempts: int = 2, timeout_s: float = PATIENCE_S):
    """A link to a device that gives these answers in turn, None hangs up; and what the device hears."""
    left = list(answers)
    with answering(lambda _: left.pop(0) if left else b"") as (address, heard):
        link = LineLink(lines.TcpLines(*address, timeout_s), read_attempts=attempts)
        try:
            yield link, heard
        finally:
            link.close()


def test_questions_are_put_again_after_silence_and_orders_are_not():
    with linked(b"", b"23.0,23.0,180.0,-70.0\r\n", timeout_s=SILENCE_S) as (link, heard):
        assert link.ask("TEMP?", "air") == "23.0,23.0,180.0,-70.0"
        assert heard == [b"TEMP?\r\n"] * 2
    with linked(b"", timeout_s=0.2) as (link, heard):
        with pytest.raises(StationTimeout, match=r"no answer to set point 'TEMP, S25.0' in 0\.2 s"):
            link.tell("TEMP, S25.0", "set point")
        assert heard == [b"TEMP, S25.0\r\n"]


@each([None, b"23.0\r\n40.0\r\n", b"\xff\xfe\r\n", b"x" * 3000])
def test_what_is_not_one_line_is_no_answer(answer):
    with linked(answer, attempts=1) as (link, _), pytest.raises(LinkLost, match="connection lost at air 'TEMP\\?'"):
        link.ask("TEMP?", "air")


def test_an_answer_without_an_end_costs_one_time_out(monkeypatch):
    readings = iter([0.0, 0.0, PATIENCE_S + 0.1])  # of the clock: at the question, before a part arrives, and after it
    monkeypatch.setattr(lines, "time", SimpleNamespace(monotonic=lambda: next(readings)))
    with linked(b"23.", attempts=1) as (link, _), pytest.raises(StationTimeout):
        link.ask("TEMP?", "air")
    assert list(readings) == []


def test_a_late_answer_never_meets_the_next_question():
    with linked(b"", b"25.0\r\n", attempts=1, timeout_s=SILENCE_S) as (link, _):
        with pytest.raises(StationTimeout):
            link.ask("TEMP?", "air")
        assert link.ask("MODE?", "mode") == "25.0"  # on a connection of its own


def test_refusals_and_that_nobody_is_there_are_told():
    with linked(b"NA:DATA OUT OF RANGE\r\n") as (link, _), pytest.raises(StationRefused, match="NA:DATA OUT OF RANGE"):
        link.tell("TEMP, S999.0", "set point")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(LinkLost, match="connection lost"):
        LineLink(lines.TcpLines("127.0.0.1", port, 0.2), read_attempts=1).ask("TEMP?", "air")


# -- what spoils data pauses a run: back to its checkpoint, measured again, told in the journal ---------------------------


RECIPE = short_recipe(poses=3)
DURING = 912.0  # the second record of RECIPE is being taken then


def run(*faults, sink=None, events=None, recipe=RECIPE, **suspenders):
    config = station_of(faults=list(faults), preset_overrides=QUIET)
    config = config.model_copy(update={"suspenders": config.suspenders.model_copy(update=suspenders)})
    events = events or MemoryLog()
    return captured(recipe, None, config, sink, events=events), events


def kinds(events):
    return [event.kind for event in events.recorded() if event.kind not in {"reference", "soak"}]


def means(sink):
    return sink.all(0).groupby(["unit", "record"])[["x", "y", "z"]].mean()


@pytest.fixture(scope="module")
def undisturbed():
    return run()


def test_a_condition_that_passes_costs_time_and_no_data(undisturbed):
    sink, events = run({"kind": "vibration", "at_s": DURING, "for_s": 60.0})
    assert kinds(events) == ["spoilt", "resumed"]
    spoilt, resumed = (next(e for e in events.recorded() if e.kind == kind) for kind in ("spoilt", "resumed"))
    assert "vibration" in spoilt.reason
    assert spoilt.record == resumed.record == 1
    assert resumed.figures["paused_s"] >= 60.0
    assert sorted(sink.records) == sorted(undisturbed[0].records)
    assert (sink.all(1)["status"] == "ok").all()
    begins = sink.all(1).drop_duplicates("record").set_index("record")["start_s"]
    assert begins[1] > DURING + 60.0 + 30.0  # gone for a while, and the soak made sure of
    far = (means(sink) - means(undisturbed[0])).abs().to_numpy().max()
    assert far < 20.0  # LSB of 1/256000 g: the table does not come to rest twice in the same place


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
    config, events = station_of(faults=[{"kind": "emergency_stop", "at_s": DURING}]), MemoryLog()
    plant = plant_of(config)
    with (
        serve_plant(config, lot_of(), plant) as station,
        pytest.raises(OperatorNeeded, match="emergency stop is pressed"),
    ):
        capture(station, RECIPE, lot_of(), MemorySink(), progress=quiet_progress, events=events)
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
    fault = {"kind": "door", "at_s": DURING, "for_s": 60.0}
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
