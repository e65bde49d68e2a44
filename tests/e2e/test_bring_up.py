"""The first hour with a device: every family passes, wrong profiles are named, and whatever happens leaves a safe device."""

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from brought_up import FAMILIES, Middle, Scripted, brought_up, id_of, served_device, verdicts
from each import each
from in_process import given
from long_suites import mostly_slow
from modbus_devices import VALUES, libmodbus_server, pymodbus_server, words_of

from docs.devices_page import read_conformance
from pipelines.tables.json_values import json_value
from schemas.errors import LinkLost, OperatorNeeded, StationError
from stations.bringup.corrected import corrected_text
from stations.bringup.session import BringUp
from stations.bringup.target import device_at
from stations.links.recorder import recorded
from stations.profile_files import load_profile, profile_text
from stations.recordings.frame_file import read_frames

ALL = ("MOVE", "STOP", "SET", "ON", "OFF", "LINK")


@pytest.fixture(autouse=True)
def _own_state(state, home, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))


@pytest.mark.slow
@pytest.mark.parametrize("name", FAMILIES)
def test_the_simulated_device_of_every_family_passes(name, tmp_path):
    """A whole bring-up with every consent, recorded, finds no difference and leaves the device as it was."""
    profile = load_profile(name)
    with served_device(name) as (port, plant), recorded(tmp_path / "frames.jsonl", "a test"):
        panel = {"temperature": 23.0, "set_point": 23.0, "feedback_position": 12.0, "humidity": 40.0}
        found = brought_up(name, port, Scripted(*ALL, panel=panel, seen="1"))
        assert [p for p in found.findings.points if p.verdict == "differs"] == []
        said = verdicts(found)
        if profile.kind == "axis":
            wanted = [
                "turns by a degree and reads it back", "turns as seen by a person", "the same order again moves nothing",
                "comes back", "stops on its way and forgets the rest", "stops by itself within 2 s without a link",
            ]  # fmt: skip
            assert not plant.outer.moving(plant.now)
            assert plant.outer.encoder(plant.now) == pytest.approx(
                12.0, abs=0.06 if name == "universal_robots" else 0.02
            )
        else:
            wanted = [
                "takes a set point and reads it back",
                "takes the old set point again",
                "keeps its set point for 2 s without a link",
            ]
            assert plant.fixture.chamber.set_point == 23.0
        assert {said[what] for what in wanted} == {"held"}, said
        assert found.findings.changes == {}
    assert len(read_frames(tmp_path / "frames.jsonl").exchanges) > 20


@each([libmodbus_server, pymodbus_server])
def test_servers_that_are_not_ours_are_reached_read_known_by_their_id_and_ordered(server):
    profile, any_id = load_profile("watlow_f4t"), server is libmodbus_server  # which answers under any
    with server(words_of(profile), device_id=5) as port:
        person = Scripted(panel={"temperature": 22.4, "set_point": 25})
        found = brought_up("watlow_f4t", port, person, given_id=0, orders=False, timeout_s=0.5)
        if any_id:  # it takes a set point and is left as it was
            ordered = brought_up("watlow_f4t", port, Scripted("SET", "LINK"), given_id=1)
            assert verdicts(ordered)["takes a set point and reads it back"] == "held"
            assert brought_up("watlow_f4t", port, Scripted(), given_id=1, orders=False).read.values["set_point"] == 25.0
    said = verdicts(found)
    assert found.target.link.device.device_id == (1 if any_id else 5)
    assert [p for p in found.findings.points if p.verdict == "differs"] == []
    assert (said["word order"], said["temperature"], said["part_number"]) == ("held", "held", "held")
    values = {p.what: p.found for p in found.findings.points if p.part == "register"}
    assert values["part_number"] == f"'{VALUES['part_number']}'"
    assert values["temperature"] == "22.4 degC"


def own_profile(original, name, *changes):
    text = profile_text(original).replace(f'name = "{original}"', f'name = "{name}"', 1)
    for before, after in changes:
        assert before in text, before
        text = text.replace(before, after)
    Path("profiles").mkdir(exist_ok=True)
    Path("profiles", f"{name}.toml").write_text(text, encoding="utf-8")
    return name


WRONG = {
    "word order": (
        ('word_order = "low_first"', 'word_order = "high_first"'), "word order", {"": {"word_order": "low_first"}}
    ),
    "scale": (
        ('name = "temperature"\naddress = 2820\nmanual = "2820"\ntype = "float32"\n',
         'name = "temperature"\naddress = 2820\nmanual = "2820"\ntype = "float32"\nscale = 0.1\n'),
        "temperature on the panel", {"temperature": {"scale": 1.0}},
    ),
    "limit": (
        ("maximum = 180.0\n", "maximum = 300.0\n"), "maximum of set_point", {"set_point": {"maximum": 180.0}},
    ),
}  # fmt: skip


@each(["word order", "scale", "limit"])
def test_a_wrong_profile_is_named_and_the_corrected_one_has_nothing_against_it(kind):
    change, what, changes = WRONG[kind]
    name = own_profile("watlow_f4t", "my_chamber", change)
    person = Scripted(panel={"temperature": 23.0, "set_point": 23.0})
    with served_device("watlow_f4t") as (port, _):
        found = brought_up(name, port, person, orders=False)
        differs = [p for p in found.findings.points if p.verdict == "differs"]
        assert what in {p.what for p in differs}, differs
        assert {p.what for p in differs} <= {what, "temperature on the panel", "working_set_point"}
        assert found.findings.changes.keys() == changes.keys()
        assert all(found.findings.changes[place] == pytest.approx(own) for place, own in changes.items() if place)
        assert all(found.findings.changes[place] == own for place, own in changes.items() if not place)
        before = Path("profiles/my_chamber.toml").read_bytes()
        text = corrected_text(found.profile, found.findings, found.made)
        Path("profiles/my_chamber_corrected.toml").write_text(text, encoding="utf-8")
        assert Path("profiles/my_chamber.toml").read_bytes() == before
        again = brought_up("my_chamber_corrected", port, person, orders=False)
        assert [p for p in again.findings.points if p.verdict == "differs"] == []


def test_addresses_counted_from_one_are_found():
    profile = load_profile("watlow_f4t")
    shifted = {address - 1: word for address, word in words_of(profile).items()}
    with pymodbus_server(shifted) as port:
        found = brought_up("watlow_f4t", port, Scripted(), given_id=1, orders=False)
    points = {p.what: p for p in found.findings.points}
    assert points["addresses"].verdict == "differs"
    assert "1 lower" in points["addresses"].found
    assert found.findings.changes["temperature"]["address"] == 2819


@pytest.mark.slow
def test_a_wrong_scale_of_an_order_is_found_by_the_first_degree_and_nothing_else_is_ordered():
    name = own_profile("oriental_az", "my_axis", (
        'name = "target"\naddress = 0x5C\nmanual = "005Ch"\ntype = "int32"\nscale = 0.001',
        'name = "target"\naddress = 0x5C\nmanual = "005Ch"\ntype = "int32"\nscale = 0.0005',
    ))  # fmt: skip
    with served_device("oriental_az", jog_deg=0.0) as (port, plant):
        plant.outer.go(plant.now, 12.0, 90.0, 200.0)
        until(lambda: not plant.outer.moving(plant.now))
        found = brought_up(name, port, Scripted(*ALL))
        assert not plant.outer.moving(plant.now)
    points = {p.what: p for p in found.findings.points}
    named = points.get("turns no further than ordered") or points["turns by a degree and reads it back"]
    assert named.verdict == "differs"
    assert points["stops on its way and forgets the rest"].verdict == "not tried"


def test_a_drive_whose_word_order_does_not_tell_is_not_moved():
    with served_device("smc_lecp6", jog_deg=0.0) as (port, plant):
        found = brought_up("smc_lecp6", port, Scripted(*ALL))
        assert plant.outer.encoder(plant.now) == pytest.approx(0.0, abs=0.01)
    assert verdicts(found)["turns by a degree and reads it back"] == "not tried"


def test_nothing_is_ordered_without_its_word_and_nobody_there_is_told():
    with served_device("oriental_az") as (port, plant):
        found = brought_up("oriental_az", port, Scripted())
        assert [e for e in plant.journal.events() if getattr(e, "device_id", 0) == 1] == []
        assert {p.found for p in found.findings.points if p.part == "order" and p.what != "state of the drive"} == {
            "no consent"
        }
        with pytest.raises(OperatorNeeded, match="devices 1, 2 answer alike"):
            brought_up("oriental_az", port, Scripted(), given_id=0)
    with pytest.raises(LinkLost, match="Connection refused"):
        brought_up("oriental_az", 9, Scripted(), timeout_s=0.2)


STEPS = {"oriental_az": ("MOVE", "STOP", "LINK"), "watlow_f4t": ("SET", "OFF", "LINK")}
FIRST = (("cut", "oriental_az", "MOVE"), ("killed", "watlow_f4t", "SET"))


def in_steps(*kinds):
    cases = [(what, name, word) for what in kinds for name, words in STEPS.items() for word in words]
    return pytest.mark.parametrize(("what", "name", "word"), mostly_slow(cases, *set(FIRST) & set(cases)))


def away(plant, axis):
    return plant.outer.moving(plant.now) if axis else plant.fixture.chamber.set_point != 23.0


def until(true, seconds=60.0):
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.02)
    assert true()


@in_steps("cut", "reboots")
def test_a_lost_link_and_a_device_that_restarts_leave_the_device_safe_and_a_whole_recording(what, name, word, tmp_path):
    axis = load_profile(name).kind == "axis"
    path = tmp_path / f"{what}-{name}-{word}.jsonl"
    with served_device(name, silence_s=0.0) as (port, plant), recorded(path, "a test"):
        middle = Middle(port)

        def happens():
            threading.Timer(0.5, lambda: middle.cut(away_s=2.0 if what == "reboots" else 0.0)).start()

        try:
            person = Scripted(*ALL, then={word: happens})
            with contextlib.suppress(StationError):  # it could not be left as found at once: its keeper does it
                brought_up(name, middle.port, person, timeout_s=1.0, silence_s=1.5)
            until(lambda: not away(plant, axis) and (axis or plant.fixture.chamber.running), 20.0)
        finally:
            middle.close()
    assert read_frames(path).remark == ""


def started(name, port, folder, answers, *more):
    """The command in a process of its own, with what a person types."""
    # a suite in the background of a shell inherits an interrupt that is ignored
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from pipelines.cli import main; main()"
    command = [sys.executable, "-c", program, "station", "bring-up", name, f"tcp://127.0.0.1:{port}"]
    command += ["--device-id", str(id_of(load_profile(name))), "--output", "out", *more]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    process = subprocess.Popen(command, cwd=folder, env=environment, **pipes)
    process.stdin.write("\n".join(answers) + "\n")
    process.stdin.flush()
    return process


GOALS_DEG = {"MOVE": 13.0, "STOP": 15.0, "LINK": 15.0}
"""Where an axis at 12° would get to by itself: one that stands short of it was stopped."""


@in_steps("killed")
def test_a_kill_in_any_step_leaves_a_safe_device_and_a_whole_recording(what, name, word, tmp_path):
    axis, words, frames = load_profile(name).kind == "axis", STEPS[name], tmp_path / "out" / "frames.jsonl"
    with served_device(name, silence_s=0.0) as (port, plant):
        answers = [*([""] * (1 if axis else 2)), *(w if w == word else "" for w in words[: words.index(word) + 1])]
        if word == "LINK" and axis:
            answers.insert(-1, "")  # the emergency stop
        process = started(name, port, tmp_path, answers, "--set", "silence=20", "--set", "watch=20")
        done = f"consent to {word}: typed"
        until(lambda: frames.is_file() and done in frames.read_text(encoding="utf-8"))
        if word != "OFF" and (axis or word != "LINK"):
            until(lambda: away(plant, axis))
        os.kill(process.pid, signal.SIGKILL)
        process.wait(10.0)
        for pipe in (process.stdin, process.stdout, process.stderr):
            pipe.close()
        until(lambda: not away(plant, axis) and (axis or plant.fixture.chamber.running))
        assert not axis or plant.outer.encoder(plant.now) < GOALS_DEG[word] - 0.1
    recording = read_frames(frames)
    assert recording.remark == ""


def test_the_command_writes_page_document_and_recording(tmp_path, monkeypatch):
    name = "watlow_f4t"
    monkeypatch.setattr(sys, "stdin", io.StringIO("23\n23\nsimulator\n"))
    with served_device(name) as (port, _):
        words = ("station", "bring-up", name, f"tcp://127.0.0.1:{port}", "--device-id", id_of(load_profile(name)))
        status, out, errors = given(*words, "--output", "out", "--read-only", "--who", "A. Person", "--json")
    assert status == 0, errors
    document = json.loads(out)
    assert document == json_value(read_conformance(tmp_path / "out" / "conformance.json"))
    assert (document["verified_on"], document["by"], document["complete"]) == ("simulator", "A. Person", True)
    assert "127.0.0.1" not in (tmp_path / "out" / "conformance.json").read_text(encoding="utf-8")
    assert "127.0.0.1" not in (tmp_path / "out" / "frames.jsonl").read_text(encoding="utf-8")
    page = (tmp_path / "out" / "conformance.html").read_text(encoding="utf-8")
    assert "http" not in page.replace("http://www.w3.org", "")


def test_speed_and_parity_of_a_serial_line_are_looked_for_and_a_missing_line_is_told():
    from other_devices import station_with
    from plant_wires import SerialPlantServer, serial_line
    from small_station import lot_of, plant_of

    profile = load_profile("eurotherm_3200")

    def brought_up_at(path):
        device, person = device_at(f"serial:{path}", profile, 3), Scripted()
        bring_up = BringUp(profile, device, person, 3, search_line=True, orders=False, timeout_s=0.3)
        bring_up.run()
        return bring_up

    plant = plant_of(station_with(chamber="eurotherm_3200"), lot_of(1))
    with serial_line() as line, SerialPlantServer(plant, line.device):
        found = brought_up_at(line.host)
        assert found.findings.count("differs") == 0
        assert found.target.link.device.link == "rtu"
        assert verdicts(found)["temperature"] == "held"
    with pytest.raises(LinkLost, match="No such file"):
        brought_up_at("/dev/there-is-none")


SIMULATED = """\
spec: "1.1"
devices:
  supply:
    eom:
      USB INSTR: {q: "\\n", r: "\\n"}
    dialogues:
      - {q: "*IDN?", r: "MAKER,SUPPLY,0,1"}
      - {q: "*OPC?", r: "1"}
      - {q: "SYST:ERR?", r: "0,No error"}
    properties:
      voltage: {default: 3.3, getter: {q: "VOLT?", r: "{:.3f}"}, setter: {q: "VOLT {}"}, specs: {min: 0, max: 36, type: float}}
      measured: {default: 3.29, getter: {q: "MEAS:VOLT?", r: "{:.3f}"}}
      output: {default: 1, getter: {q: "OUTP?", r: "{:d}"}, setter: {q: "OUTP {}"}, specs: {type: int}}
resources:
  USB0::0x1111::0x2222::0x2468::INSTR: {device: supply}
"""
SUPPLY = "USB0::0x1111::0x2222::0x2468::INSTR"


def test_an_instrument_on_visa_is_read_and_ordered_by_its_profile(tmp_path, monkeypatch):
    (tmp_path / "instruments.yaml").write_text(SIMULATED, encoding="utf-8")
    monkeypatch.setenv("TUMBLELINE_VISA", f"{tmp_path / 'instruments.yaml'}@sim")
    profile = load_profile("scpi_supply")
    person = Scripted()
    with recorded(tmp_path / "frames.jsonl", "a test"):
        bring_up = BringUp(profile, device_at(f"visa:{SUPPLY}", profile, 1), person, timeout_s=0.5)
        bring_up.run()
    values = {p.what: (p.verdict, p.found) for p in bring_up.findings.points}
    assert values["voltage"] == ("held", "3.3 V")
    target = bring_up.target
    try:
        supply = target.values()
        supply.write("voltage", 5.0)
        assert supply.number("voltage") == 5.0
        with pytest.raises(StationError, match="36"):
            supply.write("voltage", 40.0)
    finally:
        target.link.close()
    assert any(e.text and e.what == "device voltage" for e in read_frames(tmp_path / "frames.jsonl").exchanges)
    nowhere = BringUp(profile, device_at("visa:USB0::1::2::3::INSTR", profile, 1), person, timeout_s=0.5)
    with pytest.raises(StationError):
        nowhere.run()


def test_an_emergency_stop_that_a_person_holds_is_seen():
    with served_device("smc_lecp6") as (port, plant):

        def pressed():
            plant.emergency_stop = True

        found = brought_up("smc_lecp6", port, Scripted("PRESSED", then={"PRESSED": pressed}))
        points = {p.what: p for p in found.findings.points}
        assert points["reports its emergency stop"].verdict == "held"


@pytest.mark.slow
def test_an_emergency_stop_without_a_servo_is_not_tried_and_one_without_effect_differs():
    with served_device("smc_lecp6") as (port, _):
        unable = brought_up("smc_lecp6", port, Scripted("PRESSED"))
        assert verdicts(unable)["reports its emergency stop"] == "not tried"  # the servo is off: it is never ready
        ignored = brought_up("smc_lecp6", port, Scripted("MOVE", "PRESSED"))
        assert verdicts(ignored)["reports its emergency stop"] == "differs"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["oriental_az", "watlow_f4t"])
def test_ctrl_c_leaves_the_device_as_it_was_and_a_page_that_says_so(name, tmp_path):
    axis = load_profile(name).kind == "axis"
    with served_device(name, silence_s=0.0) as (port, plant):
        # the axis is on its way for twenty seconds, so that a busy machine does not come too late
        answers = ["", "", "", "", "LINK"] if axis else ["", "", "SET"]
        process = started(name, port, tmp_path, answers, "--set", "watch=20", "--set", "silence=20")
        until(lambda: away(plant, axis))
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
        assert process.returncode == 130, errors
        assert not away(plant, axis)
        assert not axis or plant.outer.encoder(plant.now) < GOALS_DEG["LINK"] - 0.1
    document = read_conformance(tmp_path / "out" / "conformance.json")
    assert document["complete"] is False
    assert document["ended"] == "interrupted"
