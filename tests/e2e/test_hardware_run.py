"""A run on a station like hardware, in wall time: killed, left safe by its watchdog, and gone on with."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from capture_double import recipe_file
from served_station import modbus_station, served, station_file
from small_station import lot_of

from stations.opening import open_devices
from stations.safety.folder import read_log as log

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 120.0
FAST = {"speed_deg_s": 90.0, "acceleration_deg_s2": 200.0}
SHORT = (
    ('units = ["A1", "A2", "A3"]', 'units = ["U000", "U001"]'),
    ("temperatures_C = [0.0, 50.0]", "temperatures_C = [23.0]\nsoak_min_s = 1.0\nallow_short_soak = true"),
    ("settle_s = 2.0", "settle_s = 0.2"),
    ("static_record_s = 30.0", "static_record_s = 0.0"),
    ('poses = "nine"', 'poses = "six"'),
    ('limits = "consumer"', 'limits = "line-quick.limits.toml"'),
    (', "bias_temperature", "scale_temperature"', ""),
)


def start(folder: Path, station: Path, name: str) -> subprocess.Popen:
    shutil.copy(ROOT / "deploy" / "recipes" / "line-quick.limits.toml", folder)
    command = [sys.executable, "-m", "pipelines.cli", "run", recipe_file(folder, *SHORT), "--station", str(station)]
    command += ["--direct", "--json", "--archive", str(folder / "archive")]
    environment = {**os.environ, "TUMBLELINE_STATE": str(folder / "state")}
    with (folder / f"{name}.out").open("w") as out, (folder / f"{name}.err").open("w") as err:
        return subprocess.Popen(command, cwd=ROOT, env=environment, stdout=out, stderr=err)


def records(folder: Path) -> dict[str, bytes]:
    return {path.parent.name: path.read_bytes() for path in folder.glob("archive/captures/*/[0-9]*/record.json")}


def wait_for(condition, process: subprocess.Popen, seconds: float = PATIENCE_S) -> float:
    begun = time.monotonic()
    while not condition():
        assert process.poll() in (None, -signal.SIGKILL)
        assert time.monotonic() - begun < seconds
        time.sleep(0.05)
    return time.monotonic() - begun


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_a_run_killed_on_hardware_is_left_safe_and_gone_on_with(tmp_path: Path) -> None:
    with served(lot_of(2)) as port:
        config = modbus_station(port, limits=FAST)
        station = station_file(tmp_path, config)
        first = start(tmp_path, station, "first")
        wait_for(lambda: len(records(tmp_path)) >= 3, first)
        second = start(tmp_path, station, "second")
        assert second.wait(PATIENCE_S) == 3
        assert (
            "another process" in (tmp_path / "second.err").read_text()
        )  # the lot's own lock; another lot would meet the lease
        first.send_signal(signal.SIGKILL)
        first.wait()
        kept = records(tmp_path)
        wait_for(lambda: any(line["event"] == "watchdog_safe" for line in log(tmp_path / "state")), first, 30.0)
        with open_devices(config, ()) as devices:
            assert devices.chamber.set_point() == 25.0
            assert devices.reader.sampling() == "stopped"
        third = start(tmp_path, station, "third")
        assert third.wait(2 * PATIENCE_S) in (0, 1), (tmp_path / "third.err").read_text()
        assert json.loads((tmp_path / "third.out").read_text())["units"][0]["unit"] == "U000"
        assert {name: data for name, data in records(tmp_path).items() if name in kept} == kept
        assert len(records(tmp_path)) == 6 + 2
        assert log(tmp_path / "state")[-1]["event"] == "left_safe"
    times = [
        json.loads(path.read_text())["time_s"] for path in sorted(tmp_path.glob("archive/captures/*/events/*.json"))
    ]
    assert times == sorted(times)  # the run's time went on, though its process was another
