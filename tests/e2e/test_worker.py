"""The line as it is deployed, on loopback: the product's server, deployments and worker, with the key."""

import shutil
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
import yaml
from capture_double import recipe_file
from orchestrator import Orchestrator, served
from root_process import ROOT, python
from served_station import modbus_station, station_file
from served_station import served as station_served
from small_station import lot_of

from pipelines.archive import Archive
from pipelines.orchestrator.settings import CLIENT_KEY
from stations.opening import open_devices
from stations.safety.folder import read_log as log

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

FAST = {"speed_deg_s": 90.0, "acceleration_deg_s2": 200.0}
LONG_DWELLS = (
    ('units = ["A1", "A2", "A3"]', 'units = ["U000", "U001"]'),
    ("temperatures_C = [0.0, 50.0]", "temperatures_C = [23.0]\nsoak_min_s = 1.0\nallow_short_soak = true"),
    ("settle_s = 2.0", "settle_s = 0.2"),
    ("dwell_s = 1.0", "dwell_s = 60.0"),
    ("static_record_s = 30.0", "static_record_s = 0.0"),
    ('poses = "nine"', 'poses = "six"'),
    ('limits = "consumer"', 'limits = "line-quick.limits.toml"'),
    (', "bias_temperature", "scale_temperature"', ""),
)


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Orchestrator]:
    """A server of its own, for workers whose archive and state lie in the test's folder."""
    places = {"TUMBLELINE_ARCHIVE": str(tmp_path / "archive"), "TUMBLELINE_STATE": str(tmp_path / "state")}
    with served(tmp_path / "orchestrator", **places) as server:
        yield server


def deployments(folder: Path, *changes: tuple[str, str]) -> str:
    """The product's deployments, with pieces of their text replaced."""
    text = (ROOT / "deploy" / "prefect.yaml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "prefect.yaml"
    path.write_text(text, encoding="utf-8")
    assert yaml.safe_load(text)["deployments"][0]["name"] == "production-line"
    return str(path)


@contextmanager
def worker(line: Orchestrator, folder: Path, *options: str) -> Iterator[subprocess.Popen]:
    """The product's worker, which gets its key from a file as a service does; told to end with the block."""
    key = folder / "prefect-auth"
    key.touch(0o600)
    key.write_text(line.key)
    environment = {name: value for name, value in line.environment.items() if name != CLIENT_KEY}
    environment |= {"CREDENTIALS_DIRECTORY": str(folder), "PREFECT_WORKER_QUERY_SECONDS": "2"}
    command = [sys.executable, "-m", "pipelines.orchestrator.worker", "start", "--station", "line-1", *options]
    with (
        (folder / "worker.log").open("ab") as out,
        subprocess.Popen(command, cwd=ROOT, env=environment, stdout=out, stderr=out) as process,
    ):
        try:
            yield process
        finally:
            process.terminate()
            process.wait(120)


def stop(line: Orchestrator, *options: str) -> tuple[int, str]:
    command = [sys.executable, "-m", "pipelines.orchestrator.worker", "stop", "--station", "line-1", *options]
    done = subprocess.run(command, cwd=ROOT, env=line.environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def test_a_scheduled_run_is_taken_by_a_worker_into_the_archive(line: Orchestrator, tmp_path: Path) -> None:
    every_minute = ('cron: "0 6 * * 1-5"', 'cron: "* * * * *"')
    path = deployments(
        tmp_path,
        every_minute,
        ("recipe: production\n    schedules:\n", f"recipe: {recipe_file(tmp_path)}\n    schedules:\n"),
    )
    python(line.environment, "-m", "pipelines.flows.deploy", path)
    line.until(lambda: line.runs("production-line", "SCHEDULED"), "a scheduled run", 60.0)
    with worker(line, tmp_path):
        line.until(lambda: line.runs("production-line", "COMPLETED"), "a run taken by the worker", 300.0)
    done = line.runs("production-line", "COMPLETED")
    assert done[0]["auto_scheduled"]
    assert done[0]["parameters"]["recipe"].endswith("small.toml")
    info = Archive(tmp_path / "archive").runs()[0]
    assert info.finished
    assert stat.S_IMODE((line.home / "prefect.db").stat().st_mode) == 0o600


def test_a_worker_that_is_told_to_end_leaves_its_station_safe_and_its_run_is_closed(
    line: Orchestrator, tmp_path: Path
) -> None:
    shutil.copy(ROOT / "deploy" / "recipes" / "line-quick.limits.toml", tmp_path)
    recipe = recipe_file(tmp_path, *LONG_DWELLS)
    python(line.environment, "-m", "pipelines.flows.deploy", "deploy/prefect.yaml")
    with station_served(lot_of(2)) as port:
        config = modbus_station(port, limits=FAST)
        station = station_file(tmp_path, config)
        order = {"parameters": {"recipe": recipe, "station": str(station)}}
        _, deployment = line.ask("/api/deployments/name/calibrate_lot/on-demand")
        status, _ = line.ask(f"/api/deployments/{deployment['id']}/create_flow_run", order)
        assert status == 201

        def sampling() -> bool:
            with open_devices(config, ()) as devices:
                return devices.reader.sampling() == "running"

        def safe() -> bool:
            with open_devices(config, ()) as devices:
                return devices.chamber.set_point() == 25.0 and devices.reader.sampling() == "stopped"

        with worker(line, tmp_path) as process:
            line.until(sampling, "a record that is being taken")
            refused_beside_it(line, tmp_path, recipe, station)
            assert stop(line, "--wait", "0")[0] == 1  # the run goes on, and no further one begins
            assert line.ask("/api/work_pools/line/queues/line-1")[1]["is_paused"]
            process.send_signal(signal.SIGTERM)
            process.wait(60)
            assert safe(), "the worker's process ended before its station was safe"
        assert any(entry["event"] == "watchdog_safe" for entry in log(tmp_path / "state"))
        assert len(line.runs("on-demand", "RUNNING")) == 1, "Prefect itself does not know that it is dead"
        with worker(line, tmp_path):
            line.until(lambda: line.runs("on-demand", "CRASHED"), "the dead run is closed")
            line.until(lambda: not line.ask("/api/work_pools/line/queues/line-1")[1]["is_paused"], "the queue goes on")
            code, told = second_worker(line)
            assert (code, "another worker works for station line-1" in told) == (3, True)
    assert "its process has ended" in line.runs("on-demand", "CRASHED")[0]["state"]["message"]


def refused_beside_it(line: Orchestrator, folder: Path, recipe: str, station: Path) -> None:
    """Another lot on the station, from elsewhere: the lease refuses it and says who drives."""
    command = [sys.executable, "-m", "pipelines.cli", "run", recipe, "--station", str(station), "--direct"]
    command += ["--units", "X1,X2", "--archive", str(folder / "other")]
    done = subprocess.run(command, cwd=ROOT, env=line.environment, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert "is driven by" in done.stderr


def second_worker(line: Orchestrator) -> tuple[int, str]:
    command = [sys.executable, "-m", "pipelines.orchestrator.worker", "start", "--station", "line-1", "--once"]
    done = subprocess.run(command, cwd=ROOT, env=line.environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def test_a_worker_that_hangs_is_ended_and_its_service_can_start_it_again(line: Orchestrator, tmp_path: Path) -> None:
    """The worker of Prefect is stopped as it lives: its heartbeats end, and the server goes on to answer."""
    python(line.environment, "-m", "pipelines.flows.deploy", deployments(tmp_path))
    beating = Orchestrator(
        line.home, line.port, line.key, {**line.environment, "PREFECT_WORKER_HEARTBEAT_SECONDS": "2"}
    )
    with worker(beating, tmp_path) as process:
        first = line.until(lambda: heartbeat(line), "a heartbeat", 120.0)
        line.until(lambda: heartbeat(line) != first, "a second one", 60.0)
        [child] = [one for one in psutil.Process(process.pid).children() if "worker" in one.cmdline()]
        child.suspend()
        assert process.wait(90) == 128 + signal.SIGKILL
    assert "it hangs and is ended" in (tmp_path / "worker.log").read_text()
    with worker(beating, tmp_path) as process:
        before = heartbeat(line)
        line.until(lambda: heartbeat(line) != before, "heartbeats again", 120.0)
        assert process.poll() is None


def heartbeat(line: Orchestrator) -> str:
    """Time of the last heartbeat of the pool's worker as the server has it; empty without one."""
    _, workers = line.ask("/api/work_pools/line/workers/filter", {})
    return str(workers[0]["last_heartbeat_time"]) if workers else ""
