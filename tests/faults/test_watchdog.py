"""Processes that die or stand still while they drive: the station is safe soon after, free for the next, and gets no more orders.

The watchdog itself against what could end it or keep it from acting: notes that fail, signals, its own death, a network away.
"""

import contextlib
import itertools
import json
import os
import platform
import random
import resource
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import Mock

import pytest
from driven_station import FAR, HOT, SLOW, SOON_S, driver, leases_of, look, safe_within, told
from long_suites import rounds
from served_station import FAST, modbus_station, moves_ordered, served, served_plant, station_file
from small_station import lot_of
from typer.testing import CliRunner

from pipelines.cli import app
from schemas.errors import STATION, LeaseLost, OperatorNeeded, StationRefused, StationTimeout
from schemas.safety import SAFE_WITHIN_S
from stations import watchdog
from stations.opening import open_devices, open_station
from stations.overview import unsafe_reason
from stations.plant.faults.proxy import ChaosProxy, WireAction
from stations.safety import folder, lease_files, leases, watchdog_client
from stations.safety.leases import Leases, holders, new_holder


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    yield tmp_path / "state"
    # a watchdog goes on trying to reach a station that is gone with its test
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"TUMBLELINE_STATE={tmp_path / 'state'}".encode() in (process / "environ").read_bytes().split(b"\0"):
                os.kill(int(process.name), signal.SIGKILL)


def test_what_makes_a_device_safe_starts_without_libraries_of_tables() -> None:
    code = "import sys, stations.watchdog, stations.bringup.keeper; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {"pandas", "scipy", "pyarrow"}.isdisjoint(loaded)


def test_a_killed_run_leaves_its_station_safe_and_free():
    with served() as port:
        config = modbus_station(port, limits=SLOW)
        with driver(config) as process:
            assert look(config)[1:] == (True, HOT, "running")
            end = time.monotonic() + SOON_S
            while look(config)[0] <= 0.0 and time.monotonic() < end:  # until the encoder shows that it is on its way
                time.sleep(0.05)
            process.kill()
            process.wait()
            assert safe_within(config, SOON_S) < SAFE_WITHIN_S
            assert 0.0 < look(config)[0] < FAR
        assert "process has ended" in told("watchdog_acts")["why"]
        assert told("watchdog_safe")["what"].startswith("outer axis stopped")
        with open_station(config, lot_of(), run="the next"):  # nobody had to delete a file
            assert {h.run for h, _ in holders(folder.state_folder(), config).values()} == {"the next"}


def test_drives_and_reader_stop_by_themselves_when_run_and_watchdog_are_both_gone():
    with served(silence_s=0.5) as port, open_devices(modbus_station(port, limits=SLOW), ()) as station:
        outer, reader = station.table.axes["outer"], station.reader
        reader.start(100.0)
        outer.start(FAR)
        for _ in range(8):  # one that is asked again and again goes on
            time.sleep(0.1)
            assert outer.moving()
        begun = outer.position()
        time.sleep(1.2)
        stood = outer.position()
        assert not outer.moving()
        assert 0.0 < stood - begun < 10.0
        assert reader.sampling() == "stopped"


def test_a_holder_that_stood_still_is_refused_when_it_wakes():
    config = modbus_station(1)
    mine = leases_of(config, lapse_s=0.05)
    mine.take()
    mine.require()
    time.sleep(0.1)
    mine.beat()  # too late
    with pytest.raises(LeaseLost, match=r"did not respond for more than 0\.05 s .* resumes where it stopped"):
        mine.require()
    mine.release()


def test_two_files_that_name_one_device_share_its_lease_and_the_second_run_is_refused_in_one_message():
    ours, theirs = modbus_station(4000, host="127.0.0.1"), modbus_station(4001, host="localhost")
    chamber = ours.devices.chamber.model_copy(update={"host": "localhost"})
    devices = theirs.devices.model_copy(update={"chamber": chamber})
    theirs = theirs.model_copy(update={"name": "another", "devices": devices})
    first, second = leases_of(ours, "lot A of deployment one", 60.0), leases_of(theirs, "b", name="another")
    first.take()
    words = (
        r"the chamber at 127\.0\.0\.1:4000/3 is driven by lot A of deployment one \(process \d+ on .*one run at a time"
    )
    with pytest.raises(OperatorNeeded, match=words) as no:
        open_station(theirs, lot_of(), run="lot B of deployment two").__enter__()
    assert (no.value.exit_status, str(no.value).count("\n")) == (STATION, 0)
    with pytest.raises(OperatorNeeded):
        second.take()
    assert second.held() == []  # all or none
    first.release()
    second.take()
    second.release()
    both = ours.model_copy(update={"devices": ours.devices.model_copy(update={"inner": ours.devices.outer})})
    mine = leases_of(both)  # devices that share a place need one lease
    mine.take()
    assert set(mine.held()) == {"outer", "chamber", "reader"}
    mine.release()


def foreign(state, config, **about):
    """Lease files as another holder, gone or far away, has left them."""
    mine = leases_of(config, "theirs")
    mine.take()
    mine.hand_over()
    for path in (state / "leases").glob("*.json"):
        path.write_text(json.dumps(json.loads(path.read_text()) | about))


def test_a_lease_of_a_dead_process_is_free_at_once(state):
    config = modbus_station(4000)
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait()
    foreign(state, config, pid=process.pid)
    mine = leases_of(config, "mine")
    mine.take()
    assert folder.read_log(state)[0]["event"] == "lease_taken_over"
    mine.release()


def test_a_lease_of_another_machine_is_free_when_its_heart_has_stopped_for_a_minute(state, monkeypatch):
    monkeypatch.setattr(leases, "PASSING_S", 0.0)
    config = modbus_station(4000)
    foreign(state, config, host="elsewhere")
    mine = leases_of(config, "mine")
    with pytest.raises(OperatorNeeded, match=r"on elsewhere since .* free at the latest 60 s"):
        mine.take()
    for path in (state / "leases").glob("*.json"):
        os.utime(path, (time.time() - SAFE_WITHIN_S - 1.0,) * 2)
    mine.take()
    mine.release()


def test_leases_are_taken_by_one_of_many(state):
    config, start = modbus_station(4000), threading.Barrier(8)

    def compete(number):
        mine = leases_of(config, f"run {number}")
        start.wait()
        with contextlib.suppress(OperatorNeeded):
            mine.take()
        return mine

    with ThreadPoolExecutor(8) as threads:
        [won] = [mine for mine in threads.map(compete, range(8)) if mine.held()]
    won.release()
    assert not list((state / "leases").glob("*.json"))


def test_a_lease_survives_that_somebody_clears_its_folder(state):
    config = modbus_station(4000)
    mine = leases_of(config)
    mine.take()
    for path in (state / "leases").glob("*.json"):
        path.unlink()
    mine.beat()
    holder, age = holders(state, config)["chamber"]
    assert (holder.run, holder.host) == ("a", platform.node())
    assert age < 5.0
    with pytest.raises(OperatorNeeded, match="driven by a"):
        leases_of(config, "the other").take()
    mine.release()


# -- the watchdog goes on ---------------------------------------------------------------------------------------------------


@contextmanager
def ends_in(error, why):
    with pytest.raises(error, match=why):
        yield


def killed(process):
    process.kill()
    process.wait()


def full_disk(state, pids):
    """No byte can be written to any file by these processes, as where the disk is full."""
    for pid in pids:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, 0))


def folder_gone(state, pids):
    shutil.rmtree(state)


def folder_in_the_way(state, pids):
    shutil.rmtree(state)
    state.write_text("no folder")


def torn_notes(state, pids):
    for path in (state / "leases").glob("*.json"):
        path.write_text('{"token": "12')


@pytest.mark.slow
@pytest.mark.parametrize("trouble", [full_disk, folder_gone, folder_in_the_way, torn_notes])
def test_a_station_is_made_safe_though_no_note_of_it_can_be_kept(state, trouble):
    with served() as port:
        config = modbus_station(port, limits=SLOW)
        with driver(config) as process:
            trouble(state, [process.pid, told("driven")["watchdog"]])
            killed(process)
            while look(config)[1:] != (False, 25.0, "stopped"):
                time.sleep(0.1)


@pytest.mark.slow
def test_a_run_finds_its_watchdog_killed_starts_it_anew_and_is_watched():
    with served() as port:
        config = modbus_station(port, limits=SLOW)
        with driver(config) as process:
            first = told("driven")["watchdog"]
            os.kill(first, signal.SIGKILL)
            assert "ended with status -9" in told("watchdog_lost")["why"]
            second = told("watchdog_anew")["pid"]
            os.kill(second, signal.SIGSTOP)  # one that stands still is no watchdog either
            third = told("watchdog_anew", after=1)["pid"]
            assert len({first, second, third}) == 3
            assert process.poll() is None
            killed(process)
            assert safe_within(config, SOON_S) < SAFE_WITHIN_S


def test_a_run_that_cannot_have_a_watchdog_any_more_ends_and_leaves_its_station_safe(monkeypatch):
    with (
        served() as port,
        ends_in(OperatorNeeded, "3 consecutive times"),
        open_station(modbus_station(port, limits=SLOW), lot_of()) as station,
    ):
        station.require()
        monkeypatch.setattr(watchdog_client.sys, "executable", "/bin/false")
        os.kill(told("driven")["watchdog"], signal.SIGKILL)
        end = time.monotonic() + SOON_S
        while time.monotonic() < end:
            station.require()
            time.sleep(0.05)
    assert folder.read_log(folder.state_folder())[-1]["event"] == "left_safe"


@pytest.mark.slow
def test_a_worker_stopped_with_its_whole_group_leaves_the_station_to_the_watchdog():
    with served() as port:
        config = modbus_station(port, limits=SLOW)
        with driver(config, start_new_session=True) as process:
            os.killpg(process.pid, signal.SIGTERM)  # as a worker's flow ends: without its `finally`
            assert process.wait(SOON_S) == -signal.SIGTERM
            os.kill(told("driven")["watchdog"], signal.SIGTERM)
            assert safe_within(config, SOON_S) < SAFE_WITHIN_S
            assert "left_safe" not in {line["event"] for line in folder.read_log(folder.state_folder())}


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_watchdog_goes_on_until_the_network_is_back_and_is_seen_to(monkeypatch):
    """The run is killed while the network is away; leases and status tell of the station meanwhile."""
    away = []

    def script(_way, _frame):
        return WireAction("drop", "request") if away else None

    with served() as port, ChaosProxy("127.0.0.1", port, script) as proxy:
        config = modbus_station(proxy.port, limits=SLOW)
        with driver(config) as process:
            away.append(True)
            killed(process)
            end, problem = time.monotonic() + SAFE_WITHIN_S + 10.0, ""
            while time.monotonic() < end or not ("the watchdog of the driver" in problem and "no answer" in problem):
                problem = unsafe_reason(folder.state_folder(), config)
                time.sleep(0.2)
            monkeypatch.setattr(leases, "SAFE_WITHIN_S", 0.0)
            with pytest.raises(OperatorNeeded, match="is held by the watchdog of the driver"):
                leases_of(config, "the next").take()
            assert look(modbus_station(port))[2] == 60.0
            away.clear()
            assert safe_within(config, SOON_S + watchdog.SLOWEST_S) < SAFE_WITHIN_S
            told("watchdog_safe")
            while unsafe_reason(folder.state_folder(), config):
                time.sleep(0.1)
    assert told("watchdog_failed")


def test_tries_become_slower_after_a_minute_and_never_end(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(watchdog, "steady", lambda: now[0])
    times, pace = [], watchdog.pauses()
    for pause in itertools.islice(pace, 1000):
        now[0] += pause
        times.append(pause)
    assert set(times[:60]) == {1.0}
    assert times[60:] == sorted(times[60:])
    assert times[-1] == watchdog.SLOWEST_S


def test_a_station_that_nobody_has_made_safe_is_told_by_status_with_exit_3(tmp_path):
    with served() as port:
        config = modbus_station(port, limits=SLOW)
        command = ["station", "status", "--station", str(station_file(tmp_path, config))]
        with driver(config) as process:
            assert CliRunner().invoke(app, command).exit_code == 0
            os.kill(told("driven")["watchdog"], signal.SIGSTOP)
            killed(process)
            os.kill(told("driven")["watchdog"], signal.SIGKILL)  # both gone: nobody has made it safe
        result = CliRunner().invoke(app, [*command, "--json"])
        assert result.exit_code == STATION
        document = json.loads(result.stdout)
        assert document["ok"] is False
        assert "neither it nor its watchdog has reported the station safe" in document["faults"]["safe state"]
        with open_station(config, lot_of()):
            pass
        assert CliRunner().invoke(app, command).exit_code == 0


def test_a_lease_is_on_the_disk_before_it_counts_and_without_room_nothing_moves(state, monkeypatch):
    synced = []
    monkeypatch.setattr(lease_files.os, "fsync", synced.append)
    mine = Leases(state, new_holder("served", "a"), {"chamber": "here"}, 10.0)
    mine.take()
    assert len(synced) == 2  # the note, and the folder that names it
    mine.release()
    no_room = Mock(side_effect=OSError(28, "No space left on device"))
    monkeypatch.setattr(lease_files.os, "fsync", no_room)
    with pytest.raises(StationRefused, match=r"cannot be written .*No space left on device.*nothing was moved"):
        open_station(modbus_station(4000), lot_of()).__enter__()
    assert not list((state / "leases").glob("*.json"))


def test_an_unreadable_lease_whose_lock_is_free_is_free(state, monkeypatch):
    config = modbus_station(4000)
    first = leases_of(config, "torn")
    first.take()
    torn_notes(state, [])
    second = leases_of(config, "mine")
    monkeypatch.setattr(leases, "PASSING_S", 0.0)
    with pytest.raises(OperatorNeeded, match="being taken by another run"):
        second.take()
    first.hand_over()
    assert "cannot be read and is not held" in unsafe_reason(state, config)
    second.take()
    assert {holder.run for holder, _ in holders(state, config).values()} == {"mine"}
    second.release()
    assert not unsafe_reason(state, config)


@pytest.mark.parametrize(("link", "ended"), [("rtu", True), ("tcp", False)])
def test_a_run_that_stands_still_on_a_serial_line_is_ended_because_one_process_can_open_it(monkeypatch, link, ended):
    config = modbus_station(4000)
    outer = config.devices.outer.model_copy(update={"link": link, "serial": "/dev/ttyS9" if link == "rtu" else ""})
    config = config.model_copy(update={"devices": config.devices.model_copy(update={"outer": outer})})
    mine = leases_of(config, role="watchdog")
    sent = []
    monkeypatch.setattr(watchdog.os, "kill", lambda pid, number: sent.append((pid, number)))
    watchdog.Watch(config, mine, os.getppid(), [])._free_lines()
    assert sent == ([(os.getppid(), signal.SIGKILL)] if ended else [])


# -- no order comes after the safe state ------------------------------------------------------------------------------------

MOVER = """
import json, random, sys
import stations.devices.table
from schemas.errors import TumblelineError
from schemas.lot import Lot
from schemas.station import StationConfig
from stations.opening import open_station
stations.devices.table.POLL_S = 0.005  # nearly all of its time between readings and orders
config, lot = StationConfig.model_validate_json(sys.argv[1]), Lot.model_validate_json(sys.argv[2])
for _ in range(int(sys.argv[3])):
    try:
        with open_station(config, lot, run="the mover") as station:
            print("driving", flush=True)
            while True:
                station.table.move(random.uniform(-40, 40), random.uniform(-40, 40))
    except TumblelineError as problem:
        print(json.dumps([type(problem).__name__, str(problem)]), flush=True)
"""


def stop_and_wake(process, plant, rng):
    """Moves ordered after the safe state, and what the run said: one stop at a random moment of its moves."""
    begun = moves_ordered(plant)
    while moves_ordered(plant) == begun:
        time.sleep(0.01)
    time.sleep(rng.uniform(0.0, 0.7))
    safe = sum(line["event"] == "watchdog_safe" for line in folder.read_log(folder.state_folder()))
    process.send_signal(signal.SIGSTOP)
    told("watchdog_safe", after=safe)
    before = moves_ordered(plant)
    process.send_signal(signal.SIGCONT)
    kind, message = json.loads(process.stdout.readline())
    told("watchdog_safe", after=safe + 1)  # once more, when the run had ended
    process.stdout.readline()  # it drives again, or has ended
    return moves_ordered(plant) - before, kind, message


@pytest.mark.slow
@pytest.mark.parametrize(
    ("times", "seed"), [(1, 11), pytest.param(rounds(30, 100), 12, marks=pytest.mark.timeout(3600))]
)
def test_no_order_comes_after_the_safe_state_when_a_run_that_stood_still_wakes(times, seed):
    with served_plant() as (port, plant):
        config = modbus_station(port, limits=FAST, safety={"heartbeat_s": 0.2, "lapse_s": 2.0})
        rng = random.Random(seed)
        with driver(config, seconds=times, script=MOVER) as process:
            stops = [stop_and_wake(process, plant, rng) for _ in range(times)]
    assert [orders for orders, _, _ in stops] == [0] * times
    for _, kind, message in stops:
        assert kind == "LeaseLost"
        assert "did not respond" in message
        assert "lost its lease" in message
        assert "brake" not in message
    log = folder.read_log(folder.state_folder())
    assert "no heartbeat of the run" in next(line["why"] for line in log if line["event"] == "watchdog_acts")
    kinds = [line["event"] for line in log]
    assert kinds.count("lease_lost") == times
    assert not {"left_safe", "not_safe"} & set(kinds)


@contextmanager
def driven():
    with served_plant() as (port, plant):
        config = modbus_station(port, limits=FAST, safety={"heartbeat_s": 1.0, "lapse_s": 10.0})
        try:
            with open_station(config, lot_of(), run="mine") as station:
                yield station, plant, station.require.__self__
        finally:
            # it makes the station safe that the run has lost, while it can be reached
            for watchdog in watchdog_client._running:
                watchdog.wait(SAFE_WITHIN_S)


def between_reading_and_order(axis, monkeypatch, happens):
    """Has something happen after the last reading before an axis' order."""
    ready = axis._require_ready

    def read_and_then():
        ready()
        happens()

    monkeypatch.setattr(axis, "_require_ready", read_and_then)


def test_a_lease_that_lapses_between_a_reading_and_the_order_leaves_it_unsent(monkeypatch):
    with ends_in(LeaseLost, "did not respond"), driven() as (station, plant, protection):
        before, axis = moves_ordered(plant), station.table.axes["inner"]

        def stands_still():
            protection.leases._beaten -= 60.0

        between_reading_and_order(axis, monkeypatch, stands_still)
        with pytest.raises(LeaseLost):
            axis.start(115.0)
        assert moves_ordered(plant) == before
        # what it finds at a station that it has lost is not why it ends
        raise OperatorNeeded("inner axis: stands at 3 deg, 115 is needed; check load and brake of the table")
    assert [line["event"] for line in folder.read_log(folder.state_folder())][:2] == ["driven", "lease_lost"]


@pytest.mark.slow
def test_an_order_that_comes_long_after_its_reading_is_not_sent_and_may_be_tried_again(monkeypatch):
    with driven() as (station, plant, _):
        before, axis = moves_ordered(plant), station.table.axes["inner"]
        with monkeypatch.context() as patch:
            between_reading_and_order(
                axis, patch, lambda: setattr(axis._registers, "_read_at", axis._registers._read_at - 6)
            )
            with pytest.raises(StationTimeout, match=r"6\.\d s after the reading that it depends on, at most 1 s"):
                axis.start(30.0)
        assert moves_ordered(plant) == before
        station.table.move(0.0, 30.0)
        assert moves_ordered(plant) > before
        connection = axis._registers._link._link._wire._socket  # what was not delivered ends with it
        linger = connection.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8)
        assert struct.unpack("ii", linger) == (1, 0)
        assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 1000


def test_a_run_whose_leases_were_cleared_away_and_taken_sends_nothing_more(state):
    with ends_in(LeaseLost, "now belongs to the other"), driven() as (station, plant, _):
        for path in (state / "leases").iterdir():
            path.unlink()
        other = leases_of(station.config, "the other")
        other.take()
        try:
            with pytest.raises(LeaseLost):
                station.table.move(10.0, 10.0)
            assert moves_ordered(plant) == 0
            station.chamber.set_temperature(40.0)
        finally:
            other.release()
