"""The watchdog against what could end it or keep it from acting: notes that fail, signals, its own death, a network away."""

import itertools
import json
import os
import resource
import shutil
import signal
import time

import pytest
from driven_station import SLOW, SOON_S, driver, leases_of, look, safe_within, told
from served_station import modbus_station, served, station_file
from small_station import lot_of
from typer.testing import CliRunner

from pipelines.cli import app
from schemas.errors import STATION, OperatorNeeded, StationRefused
from schemas.safety import SAFE_WITHIN_S
from stations import watchdog
from stations.opening import open_station
from stations.overview import unsafe_reason
from stations.plant.faults.proxy import ChaosProxy, WireAction
from stations.safety import folder, lease_files, leases, watchdog_client
from stations.safety.leases import Leases, holders, new_holder

pytestmark = pytest.mark.usefixtures("state")


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
@pytest.mark.parametrize(
    "trouble",
    [full_disk, *(pytest.param(one, marks=pytest.mark.slow) for one in (folder_gone, folder_in_the_way, torn_notes))],
)
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
    with served() as port, pytest.raises(OperatorNeeded, match="3 consecutive times"):
        ends_without_watchdog(modbus_station(port, limits=SLOW), monkeypatch)
    assert folder.read_log(folder.state_folder())[-1]["event"] == "left_safe"


def ends_without_watchdog(config, monkeypatch):
    with open_station(config, lot_of()) as station:
        station.require()
        monkeypatch.setattr(watchdog_client.sys, "executable", "/bin/false")
        os.kill(told("driven")["watchdog"], signal.SIGKILL)
        end = time.monotonic() + SOON_S
        while time.monotonic() < end:
            station.require()
            time.sleep(0.05)


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


def away_and_back(seconds):
    """The run killed while the network is away for so long; what the leases tell of the station meanwhile."""
    away = []
    with (
        served() as port,
        ChaosProxy("127.0.0.1", port, lambda _way, _frame: WireAction("drop", "request") if away else None) as proxy,
    ):
        config = modbus_station(proxy.port, limits=SLOW)
        with driver(config) as process:
            away.append(True)
            killed(process)
            end, problems = time.monotonic() + seconds, []
            while time.monotonic() < end or not problems:
                problem = unsafe_reason(folder.state_folder(), config)
                problems += [problem] if "the watchdog of the driver" in problem and "no answer" in problem else []
                time.sleep(0.2)
            with pytest.raises(OperatorNeeded, match="is held by the watchdog of the driver"):
                refused_soon(config)
            assert look(modbus_station(port))[2] == 60.0
            away.clear()
            assert safe_within(config, SOON_S + watchdog.SLOWEST_S) < SAFE_WITHIN_S
            told("watchdog_safe")
            while unsafe_reason(folder.state_folder(), config):
                time.sleep(0.1)


def refused_soon(config):
    following = leases_of(config, "the next")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(leases, "SAFE_WITHIN_S", 0.0)
        following.take()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_watchdog_goes_on_until_the_network_is_back_and_is_seen_to():
    away_and_back(SAFE_WITHIN_S + 10.0)
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


def test_a_second_run_of_a_station_is_refused_in_one_message_whatever_started_it(tmp_path):
    config = modbus_station(4000)
    first = leases_of(config, "lot A of deployment one", 60.0)
    first.take()
    words = r"driven by lot A of deployment one \(process \d+ on .*one run at a time"
    with pytest.raises(OperatorNeeded, match=words) as no:
        open_station(config, lot_of(), run="lot B of deployment two").__enter__()
    assert no.value.exit_status == STATION
    assert str(no.value).count("\n") == 0
    first.release()


def test_a_lease_is_on_the_disk_before_it_counts_and_without_room_nothing_moves(state, monkeypatch):
    synced = []
    monkeypatch.setattr(lease_files.os, "fsync", synced.append)
    mine = Leases(state, new_holder("served", "a"), {"chamber": "here"}, 10.0)
    mine.take()
    assert len(synced) == 2  # the note, and the folder that names it
    mine.release()

    def no_room(_handle):
        raise OSError(28, "No space left on device")

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
