"""Processes that die or stand still while they drive: the station is safe soon after, and free for the next."""

import contextlib
import json
import os
import platform
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from driven_station import FAR, HOT, SLOW, SOON_S, driver, leases_of, look, safe_within, told
from long_suites import mostly_slow
from served_station import modbus_station, served
from small_station import lot_of

from schemas.errors import LeaseLost, OperatorNeeded
from schemas.safety import SAFE_WITHIN_S
from stations.opening import open_devices, open_station
from stations.safety import folder, leases
from stations.safety.leases import holders


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    yield tmp_path / "state"
    # a watchdog goes on trying to reach a station that is gone with its test
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"TUMBLELINE_STATE={tmp_path / 'state'}".encode() in (process / "environ").read_bytes().split(b"\0"):
                os.kill(int(process.name), signal.SIGKILL)


@pytest.mark.parametrize("module", mostly_slow(["stations.watchdog", "stations.bringup.keeper"], "stations.watchdog"))
def test_what_makes_a_device_safe_starts_without_libraries_of_tables(module: str) -> None:
    code = f"import sys, {module}; print(*sys.modules)"
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


@pytest.mark.slow
def test_a_run_that_ends_in_peace_leaves_its_station_safe_too():
    with served() as port:
        config = modbus_station(port, limits=SLOW)
        with driver(config, seconds=0.2) as process:
            assert process.wait(SOON_S) == 0
            _, moving, set_point, sampling = look(config)
            assert (moving, set_point, sampling) == (False, 25.0, "stopped")
        assert [line["event"] for line in folder.read_log(folder.state_folder())] == ["driven", "left_safe"]


def test_two_files_that_name_one_device_share_its_lease():
    ours = modbus_station(4000, host="127.0.0.1")
    theirs = modbus_station(4001, host="localhost").model_copy(update={"name": "another"})
    chamber = ours.devices.chamber.model_copy(update={"host": "localhost"})
    theirs = theirs.model_copy(update={"devices": theirs.devices.model_copy(update={"chamber": chamber})})
    first = leases_of(ours)
    first.take()
    second = leases_of(theirs, "b", name="another")
    with pytest.raises(OperatorNeeded, match=r"the chamber at 127\.0\.0\.1:4000/3 is driven by a "):
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
    config = modbus_station(4000)
    won, lost, start = [], [], threading.Barrier(8)

    def compete(number):
        mine = leases_of(config, f"run {number}")
        start.wait()
        try:
            mine.take()
            won.append(mine)
        except OperatorNeeded:
            lost.append(number)

    threads = [threading.Thread(target=compete, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(won), len(lost)) == (1, 7)
    won[0].release()
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
    mine.release()
