"""Recordings of links: a replayed run gives the same tables, a replayed device the same answers, a recorded defect a test."""

import json
import os
import re
import runpy
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from brought_up import Middle, Scripted, brought_up, served_device
from capture_double import BRIEF, recipe_file
from each import each
from in_process import command

from pipelines.archive import Archive
from pipelines.commissioning.frames import kind_of, timeline
from schemas.errors import DataRejected, StationTimeout, WrongUse
from schemas.station_devices import Device
from stations.codec import encode
from stations.links import recorder as recording_module
from stations.links.making import SingleLink
from stations.links.recorder import FrameRecorder, recorded
from stations.profile_files import load_profile
from stations.recordings.clients_view import what_a_client_gets
from stations.recordings.frame_file import read_frames
from stations.recordings.other_programs import read_recording
from stations.recordings.replay_server import ReplayServer

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data" / "frames"


pytestmark = pytest.mark.usefixtures("state")


def made(recipe, archive, *more):
    """The newest run after the command, with its exit status and messages."""
    done = command(["run", recipe, "--archive", str(archive), "--direct", *more])
    assert done.returncode in {0, 1}, done.stderr
    return Archive(archive).run("latest"), done


QUICK = (*BRIEF, ('units = ["A1", "A2", "A3"]', 'units = ["A1"]'))


@pytest.fixture(scope="module")
def recorded_run(tmp_path_factory):
    """A run with the recording of its links: recipe, archive, recording."""
    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TUMBLELINE_STATE", str(folder / "state"))
        recipe, frames = recipe_file(folder, *QUICK), folder / "run-1.jsonl"
        made(recipe, folder / "archive", "--record", str(frames))
    return recipe, folder / "archive", frames


@pytest.mark.slow
def test_a_replayed_run_gives_the_same_tables_bit_for_bit(recorded_run, tmp_path):
    recipe, archive, frames = recorded_run
    first = Archive(archive).run("latest")
    again, done = made(recipe, tmp_path / "two", "--replay", str(frames))
    assert "were not asked for" not in done.stderr
    assert sorted(first.tables()) == sorted(again.tables())
    for name in first.tables():
        assert first.table(name).equals(again.table(name)), name
    refused = command(["run", recipe, "--archive", str(tmp_path / "two"), "--direct", "--replay", str(frames)])
    assert refused.returncode == 2
    assert "has measurements of this lot already" in refused.stderr
    other = recipe_file(tmp_path, *QUICK, ("dwell_s = 1.0", "dwell_s = 1.5"))
    departed = command(["run", other, "--archive", str(tmp_path / "three"), "--direct", "--replay", str(frames)])
    assert departed.returncode == 2
    assert re.search(r"replay: .* continues with", departed.stderr), departed.stderr


@pytest.mark.slow
def test_a_run_with_faults_of_the_wire_is_replayed_with_them(tmp_path):
    recipe, frames = recipe_file(tmp_path, *QUICK), tmp_path / "run.jsonl"
    faults = ["--fault", "time_out:at_s=37.5", "--fault", "silent:device=reader:at_s=60:for_s=3"]
    first, _ = made(recipe, tmp_path / "one", "--record", str(frames), *faults)
    assert {e.failed for e in read_frames(frames).exchanges} >= {"", "silence"}
    again, _ = made(recipe, tmp_path / "two", "--replay", str(frames), *faults)
    for name in sorted({*first.tables()} - {"events"}):
        assert first.table(name).equals(again.table(name)), name
    told, then = (
        [re.sub(r"127\.0\.0\.1:\d+", "", one) for one in run.table("events")["reason"]] for run in (first, again)
    )
    assert told == then  # the simulated station is at another port in every process


@contextmanager
def read_by_us(port, name="watlow_f4t", device_id=3, timeout_s=2.0):
    """A client of ours at a port."""
    profile = load_profile(name)
    device = Device(profile=name, device_id=device_id, host="127.0.0.1", port=port)
    link = SingleLink(device, profile, timeout_s)
    try:
        yield link.registers(), profile
    finally:
        link.close()


def recorded_reads(folder, late_s=0.0):
    """A recording of a chamber: two temperatures with an order between them, a refused read, one without an answer."""
    path = folder / "frames.jsonl"
    with served_device("watlow_f4t") as (port, plant), recorded(path, "a test"):
        middle = Middle(port, late_s)
        try:
            with read_by_us(middle.port) as (link, profile):
                air = profile.register("temperature")
                link.read(3, air.address, 2, "temperature")
                set_point = profile.register("set_point")
                link.write(3, set_point.address, encode(set_point, "low_first", 60.0), "set_point")
                plant.advance(120_000_000)
                link.read(3, air.address, 2, "temperature")
                with pytest.raises(Exception, match="exception 2"):
                    link.read(3, 7, 1, "nothing")
            if late_s == 0.0:
                silent = socket.create_server(("127.0.0.1", 0))
                try:
                    with read_by_us(silent.getsockname()[1], timeout_s=0.2) as (link, _), pytest.raises(StationTimeout):
                        link.read(3, air.address, 2, "temperature")
                finally:
                    silent.close()
        finally:
            middle.close()
    return path


def test_a_replayed_device_answers_as_late_and_as_silent_as_the_recorded_one(tmp_path):
    recording = read_frames(recorded_reads(tmp_path, late_s=0.3))
    exchanges = recording.exchanges
    assert [kind_of(e) for e in exchanges] == ["read", "order", "read", "refused"]
    new = []
    with ReplayServer(recording, new=new.append) as server, read_by_us(server.port) as (link, profile):
        begun = time.monotonic()
        first = link.read(3, 2820, 2, "temperature")
        assert time.monotonic() - begun >= 0.29
        assert link.read(3, 2820, 2, "temperature") == first  # no order has been given yet
        link.write(3, 2782, encode(profile.register("set_point"), "low_first", 60.0), "set_point")
        assert link.read(3, 2820, 2, "temperature") != first
        with pytest.raises(Exception, match="exception 2"):
            link.read(3, 2774, 2, "set_point_low")
        assert new == ["device device 3: 03 0a d6 00 02"]
        with pytest.raises(Exception, match="exception 11"):
            link.read(4, 2820, 2, "temperature")


def test_silences_are_replayed_as_silences_and_a_recording_becomes_a_test(tmp_path):
    path = recorded_reads(tmp_path)
    told = what_a_client_gets(path)
    assert told[-1] == "device: read temperature -> silence"
    whole = path.read_bytes()
    path.write_bytes(whole[:-7])  # a torn last line is left out
    assert "incomplete" in read_frames(path).remark
    assert len(read_frames(path).exchanges) == 4
    path.write_bytes(whole.replace(b'"q":"03', b'"q":"zz', 1))
    with pytest.raises(DataRejected, match="line 3"):
        read_frames(path)
    path.write_bytes(whole)
    folder = tmp_path / "tests"
    folder.mkdir()
    outputs = ["--output", str(folder / "test_chamber.py"), "--output", str(tmp_path / "p.html")]
    done = command(["station", "frames", str(path), *outputs])
    assert done.returncode == 0, done.stderr
    assert "<svg" in (tmp_path / "p.html").read_text(encoding="utf-8")
    text = (folder / "test_chamber.py").read_text(encoding="utf-8")
    (folder / "test_wrong.py").write_text(text.replace("60 degC", "61 degC"), encoding="utf-8")
    run_tests_of(folder / "test_chamber.py")
    with pytest.raises(AssertionError):
        run_tests_of(folder / "test_wrong.py")


def run_tests_of(path):
    """Call the tests of a module as pytest would."""
    tests = [thing for name, thing in runpy.run_path(str(path)).items() if name.startswith("test_")]
    assert tests
    for test in tests:
        test()


@pytest.mark.slow  # its server: test_a_replayed_device_answers_as_late_and_as_silent_as_the_recorded_one
def test_the_replay_command_answers_mbpoll_and_names_what_is_new(tmp_path):
    program = shutil.which("mbpoll")
    if program is None:
        pytest.skip("mbpoll is not installed; 'make debian' as root installs it")
    path = recorded_reads(tmp_path)
    command = [sys.executable, "-m", "pipelines", "station", "replay", str(path), "--port", "0", "--json"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    text = ""
    while not text.rstrip().endswith("}") or text.count("{") != text.count("}"):
        text += process.stdout.readline()
    port = json.loads(text)["port"]

    def poll(address):
        options = f"-m tcp -p {port} -a 3 -0 -r {address} -c 1 -t 4:float -1 -o 5 127.0.0.1".split()
        return subprocess.run([program, *options], capture_output=True, text=True, check=False, timeout=20)

    assert re.search(r"\[2820\]:\s+2[23]\.", poll(2820).stdout)
    assert "Illegal data address" in poll(2774).stderr
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 3
    assert "asked something new: device device 3: 03 0a d6 00 02" in errors


@each(["mbpoll-tcpdump.pcap", "mbpoll-editcap.pcapng"])
def test_captures_of_other_programs_hold_what_mbpoll_asked(name):
    exchanges = read_recording(DATA / name).exchanges
    assert [(e.device_id, e.request.hex(), e.reply.hex()) for e in exchanges] == [
        (3, "030b040002", "0304fdce41b7"),
        (1, "0300cc0002", "030400000000"),
        (3, "0300070002", "8302"),
        (77, "0300070001", "8304"),
    ]
    assert all(0.0 < e.seconds < 0.1 for e in exchanges)


LOGS = {
    "csv": (
        "No;Time;Direction;Data\n1;10:22:01.100;Tx;01 03 00 CC 00 02 04 34\n2;10:22:01.131;Rx;01 03 04 00 00 2E E0 E6 1B\n"
        "3;10:22:02.100;Tx;01 03 00 CC 00 02 04 34\n"
    ),
    "poll": (
        "Tx:000000-01 03 00 CC 00 02 04 34\nRx:000001-01 03 04 00 00 2E E0 E6 1B\nTx:000002-01 03 00 CC 00 02 04 34\n"
    ),
    "monitor": (
        "[RTU]>Tx > 10:22:01:100 - 01 03 00 CC 00 02 04 34\n[RTU]>Rx > 10:22:01:131 - 01 03 04 00 00 2E E0 E6 1B\n"
        "[RTU]>Tx > 10:22:02:100 - 01 03 00 CC 00 02 04 34\n"
    ),
    "tcp": (
        '"12.100","Sent","00 01 00 00 00 06 01 03 00 CC 00 02"\n"12.131","Received","00 01 00 00 00 07 01 03 04 00 00 2E E0"\n'
        '"13.100","Sent","00 02 00 00 00 06 01 03 00 CC 00 02"\n'
    ),
}


@each(LOGS)
def test_logs_of_modbus_tools_are_read(name, tmp_path):
    path = tmp_path / f"{name}.log"
    path.write_text(LOGS[name], encoding="utf-8")
    first, second = read_recording(path).exchanges
    assert (first.device_id, first.request.hex(), first.reply.hex()) == (1, "0300cc0002", "030400002ee0")
    assert (second.reply, second.failed) == (None, "silence")
    if name != "poll":  # which has no times
        assert first.seconds == pytest.approx(0.031, abs=1e-6)
        assert second.at_s == pytest.approx(1.0, abs=1e-6)


@each([b"", b"hello\nworld\n", b"{}\n", b"\xd4\xc3\xb2\xa1rest", bytes(range(256)) * 4])
def test_what_is_no_recording_is_refused_in_one_message(content, tmp_path):
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(DataRejected, match="recording: "):
        read_recording(path)


def test_a_recording_is_bounded_has_no_password_never_overwrites_and_never_ends_what_it_records(tmp_path, capsys):
    path = tmp_path / "small.jsonl"
    recorder = FrameRecorder(path, "a test", largest=400)
    for _ in range(50):
        recorder.exchange("device", 1, b"\x03\x00\x01\x00\x01", 0.0, b"\x03\x02\x00\x01", "")
    recorder.close()
    assert path.stat().st_size <= 520
    assert "it ends early" in read_frames(path).remark
    assert capsys.readouterr().err.count("ends here") == 1
    with pytest.raises(WrongUse, match="there already"):
        FrameRecorder(path, "a test")
    path.unlink()
    recorder = FrameRecorder(path, "a test")
    recorder.line("supply", "SYST:PASS:CEN 'open sesame'", "supply unlock", 0.0, "1", "")  # a password is withheld
    recorder.line("supply", "VOLT?", "supply voltage", 0.0, "3.3", "")
    recorder.close()
    assert "sesame" not in path.read_text(encoding="utf-8")
    assert [e.request for e in read_frames(path).exchanges] == [b"VOLT?"]
    for word, secret in {"damping": 0, "spin": 0, "passband": 0, "clipping": 0, "password": 1, "pin_code": 1,
                         "SYST:PASS:CEN": 1, "access_token": 1}.items():  # fmt: skip
        assert bool(recording_module.SECRET.search(f"device {word}")) == bool(secret), word
    full = FrameRecorder(tmp_path / "full.jsonl", "a test")
    os.close(full._file)
    full._file = os.open("/dev/full", os.O_WRONLY)
    full.note("this has no room")
    full.note("and is not tried again")
    assert capsys.readouterr().err.count("No space left on device") == 1


def test_a_station_check_is_recorded_with_every_device_and_drawn(tmp_path):
    path = tmp_path / "check.jsonl"
    done = command(["station", "check", "--read-only", "--record", str(path), "--slots", "2"])
    assert done.returncode == 0, done.stderr
    recording = read_frames(path)
    assert {d.name for d in recording.devices} >= {"outer", "inner", "chamber", "reader", "slot 0", "slot 1"}
    chart = timeline(recording)
    assert set(chart.plots[0].y.names) >= {"outer", "chamber", "reader"}
    assert recording_module.active_recorder() is None
    document = json.loads(command(["station", "frames", str(path), "--json"]).stdout)
    assert len(document["frames"]) == len(recording.exchanges)


def test_a_chamber_with_lines_is_recorded_and_replayed(tmp_path):
    path = tmp_path / "frames.jsonl"
    with served_device("espec_p300") as (port, _), recorded(path, "a test"):
        brought_up("espec_p300", port, Scripted("SET"))
    recording = read_frames(path)
    assert any(e.text and e.writes for e in recording.exchanges)
    with ReplayServer(recording) as server:
        again = brought_up("espec_p300", server.lines_at["device"], Scripted(), orders=False)
    assert [p for p in again.findings.points if p.verdict == "differs"] == []


def test_the_station_page_draws_the_recordings_of_the_archive(recorded_run, tmp_path):
    from asgi_client import AsgiClient

    from pipelines.workbench.application import create_app
    from pipelines.workbench.settings import WorkbenchSettings

    archive = shutil.copytree(recorded_run[1], tmp_path / "archive")
    (archive / "recordings").mkdir()
    shutil.copy(recorded_run[2], archive / "recordings")
    settings = WorkbenchSettings(archive=str(archive), folder=tmp_path / "bench")
    client, key = AsgiClient(create_app(settings), settings.address), {"authorization": f"Bearer {settings.token}"}
    page = client.get("/station", headers=key).text
    assert "run-1.jsonl" in page
    page = client.get("/station?recording=run-1.jsonl", headers=key)
    assert page.status_code == 200
    assert "Exchanges of recording run-1.jsonl" in page.text
    table = client.get("/station/figure/frames.csv?recording=run-1.jsonl", headers=key)
    assert table.status_code == 200
    assert "slot 0" in table.text
    other = client.get("/station/figure/frames.csv?recording=../run-1.jsonl", headers=key)
    assert other.status_code == 400 or "has none called" in other.text
    verified = command(["verify", "--archive", str(archive)])
    assert "recordings/" not in verified.stdout + verified.stderr
