"""A process that drives a served station, and looks at what became of the station when it is gone."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from small_station import lot_of

from stations.opening import open_devices
from stations.safety import folder
from stations.safety.lease_files import addresses
from stations.safety.leases import Leases, new_holder

ROOT = Path(__file__).resolve().parents[1]
HOT, FAR = 60.0, 170.0
SOON_S = 40.0  # on a busy machine; what must hold is held against SAFE_WITHIN_S
SLOW = {"speed_deg_s": 5.0}

DRIVER = """
import sys, time
from schemas.lot import Lot
from schemas.station import StationConfig
from stations.opening import open_station
config = StationConfig.model_validate_json(sys.argv[1])
with open_station(config, Lot.model_validate_json(sys.argv[2]), run="the driver") as station:
    station.chamber.set_temperature(60.0)
    station.reader.start(100.0)
    station.table.axes["outer"].start(170.0)
    print("driving", flush=True)
    time.sleep(float(sys.argv[3]))
"""


@contextmanager
def driver(config, seconds=120.0, script=DRIVER, **more):
    """A process that drives the station: hot chamber, a slow move, sampling."""
    arguments = [sys.executable, "-c", script, config.model_dump_json(), lot_of().model_dump_json(), str(seconds)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(arguments, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, **more) as process:
        try:
            assert process.stdout.readline() == "driving\n"
            yield process
        finally:
            with_last_breath(process)


def with_last_breath(process):
    if process.poll() is None:
        process.send_signal(signal.SIGCONT)
        process.kill()
    process.wait(10.0)


def leases_of(config, run="a", lapse_s=10.0, name="served", role="run"):
    """Leases on the devices of a station for a run."""
    return Leases(folder.state_folder(), new_holder(name, run, role), addresses(config), lapse_s)


def look(config):
    """Angle of the outer axis, whether it moves, the chamber's set point, whether samples are taken."""
    with open_devices(config, ()) as station:
        registers = station.chamber._values
        axis = station.table.axes["outer"]
        return (
            axis.position(),
            axis._registers.flags("status")["move"],
            registers.number("set_point"),
            station.reader._registers.text("sampling"),
        )


def safe_within(config, seconds):
    """Seconds until the station is in its safe state."""
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        _, moving, set_point, sampling = look(config)
        if (moving, set_point, sampling) == (False, 25.0, "stopped"):
            return time.monotonic() - begun
        time.sleep(0.1)
    pytest.fail(f"not safe after {seconds} s: {look(config)}; {folder.read_log(folder.state_folder())}")


def told(event, after=0):
    """The machine's log of one kind of event, once there are more than ``after``."""
    end = time.monotonic() + SOON_S
    while time.monotonic() < end:
        lines = [line for line in folder.read_log(folder.state_folder()) if line["event"] == event]
        if len(lines) > after:
            return lines[-1]
        time.sleep(0.05)
    return pytest.fail(f"no {event}: {folder.read_log(folder.state_folder())}")
