"""The line as it is deployed, on loopback: server, deployments, workers, stations; killed, hung, restarted, on two computers."""

import json
import os
import signal
import sqlite3
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import psutil
import pytest
from capture_double import recipe_file
from lines import deployments, kill_all, order, worker
from orchestrator import Orchestrator, served
from postgres_server import Postgres, postgres
from root_process import ROOT, python
from s3_server import CREDENTIALS, s3_bucket
from served_station import FAST, modbus_station, short_recipe_file, station_file
from served_station import served as station_served
from small_station import lot_of

from pipelines.archive import Archive
from pipelines.chain.chain import ORDER
from pipelines.flows.local import local_server
from pipelines.integrity.archive import verify
from pipelines.orchestrator.database import copy_database, restore_database
from stations.opening import open_devices
from stations.safety.folder import read_log

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

MINUTELY = [{"cron": "* * * * *", "timezone": "UTC"}]
QUEUE = "/api/work_pools/line/queues/line-1"
WITHIN_S = 60.0 + 15.0
"""A minute without a heartbeat, and the steps of the server's own services (5 s each)."""


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Orchestrator]:
    """A server of its own, for workers whose archive and state lie in the test's folder."""
    places = {"TUMBLELINE_ARCHIVE": str(tmp_path / "archive"), "TUMBLELINE_STATE": str(tmp_path / "state")}
    with served(tmp_path / "orchestrator", **places) as server:
        yield server


def deployed(line: Orchestrator, folder: Path, *wanted: dict[str, Any]) -> None:
    python(line.environment, "-m", "pipelines.flows.deploy", deployments(folder, [*wanted]))


def tumbleline(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, without what would lead it to another orchestrator."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT_", "AWS_"))}
    own |= environment
    command = [sys.executable, "-m", "pipelines.cli", *map(str, words)]
    return subprocess.run(command, cwd=ROOT, env=own, capture_output=True, text=True, timeout=400, check=False)


def worker_command(line: Orchestrator, *words: str) -> tuple[int, str]:
    command = [sys.executable, "-m", "pipelines.orchestrator.worker", words[0], "--station", "line-1", *words[1:]]
    done = subprocess.run(command, cwd=ROOT, env=line.environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def safe(config: Any) -> bool:
    with open_devices(config, ()) as devices:
        return devices.chamber.set_point() == 25.0 and devices.reader.sampling() == "stopped"


def sampling(config: Any) -> bool:
    with open_devices(config, ()) as devices:
        return devices.reader.sampling() == "running"


def test_a_worker_that_is_told_to_end_leaves_its_station_safe_and_its_run_is_closed(
    line: Orchestrator, tmp_path: Path
) -> None:
    recipe = short_recipe_file(tmp_path, 60.0)
    python(line.environment, "-m", "pipelines.flows.deploy", "deploy/prefect.yaml")
    with station_served(lot_of(2)) as port:
        config = modbus_station(port, limits=FAST)
        station = station_file(tmp_path, config)
        order(line, "on-demand", recipe=recipe, station=str(station))
        with worker(line, tmp_path, host="") as process:
            line.until(lambda: sampling(config), "a record that is being taken")
            # another lot on the station, from elsewhere: the lease refuses it and says who drives
            own = ("--station", station, "--direct", "--units", "X1,X2", "--archive", tmp_path / "other")
            beside = tumbleline("run", recipe, *own, **line.environment)
            assert (beside.returncode, "is driven by" in beside.stderr) == (3, True)
            assert worker_command(line, "stop", "--wait", "0")[0] == 1  # the run goes on, and no further one begins
            assert line.ask(QUEUE)[1]["is_paused"]
            process.send_signal(signal.SIGTERM)
            process.wait(60)
            assert safe(config), "the worker's process ended before its station was safe"
        assert any(entry["event"] == "watchdog_safe" for entry in read_log(tmp_path / "state"))
        assert len(line.runs("on-demand", "RUNNING")) == 1, "Prefect itself does not know that it is dead"
        with worker(line, tmp_path, host=""):
            line.until(lambda: line.runs("on-demand", "CRASHED"), "the dead run is closed")
            line.until(lambda: not line.ask(QUEUE)[1]["is_paused"], "the queue goes on")
            status, told = worker_command(line, "start", "--once")
            assert (status, "another worker works for station line-1" in told) == (3, True)
    assert "its process has ended" in line.runs("on-demand", "CRASHED")[0]["state"]["message"]


def test_a_worker_that_hangs_is_ended_and_its_service_can_start_it_again(line: Orchestrator, tmp_path: Path) -> None:
    """The worker of Prefect is stopped as it lives: its heartbeats end, and the server goes on to answer."""
    deployed(line, tmp_path, {})
    line.environment["PREFECT_WORKER_HEARTBEAT_SECONDS"] = "2"
    with worker(line, tmp_path) as process:
        first = line.until(lambda: heartbeat(line), "a heartbeat", 120.0)
        line.until(lambda: heartbeat(line) != first, "a second one", 60.0)
        [child] = [one for one in psutil.Process(process.pid).children() if "worker" in one.cmdline()]
        child.suspend()
        assert process.wait(90) == 128 + signal.SIGKILL
    assert "it hangs and is ended" in (tmp_path / "worker.log").read_text()
    with worker(line, tmp_path) as process:
        before = heartbeat(line)
        line.until(lambda: heartbeat(line) != before, "heartbeats again", 120.0)
        assert process.poll() is None


def heartbeat(line: Orchestrator) -> str:
    """Time of the last heartbeat of the pool's worker as the server has it; empty without one."""
    _, workers = line.ask("/api/work_pools/line/workers/filter", {})
    return str(workers[0]["last_heartbeat_time"]) if workers else ""


def test_schedules_and_persons_on_two_computers_get_the_station_one_after_the_other(
    line: Orchestrator, tmp_path: Path
) -> None:
    """Two deployments every minute, orders beside them, two workers on one queue: no two runs overlap."""
    recipe, names = recipe_file(tmp_path), ("early", "late", "hand")
    common = {"parameters": {"recipe": recipe}}
    wanted = [common | {"name": name, "schedules": MINUTELY, "concurrency_limit": 1} for name in names[:2]]
    deployed(line, tmp_path, *wanted, common | {"name": "hand"})

    def spans() -> list[tuple[datetime, datetime]]:
        done = [run for name in names for run in line.runs(name, "COMPLETED")]
        return sorted((when(run["start_time"]), when(run["end_time"])) for run in done)

    with (
        worker(line, tmp_path / "a", host="host-a"),
        worker(line, tmp_path / "b", host="host-b", state=tmp_path / "state-b"),
    ):
        for _ in range(3):
            order(line, "hand", recipe=recipe)
        line.until(lambda: len(spans()) >= 4 and len(line.runs("hand", "COMPLETED")) == 3, "four runs", 800.0)
    assert [(one, other) for one, other in pairwise(spans()) if other[0] < one[1]] == []
    assert len(Archive(tmp_path / "archive").runs()) >= 4
    log = (tmp_path / "a" / "worker.log").read_text()
    assert "is driven by" not in log, "the queue, not the lease, keeps them apart"


def when(text: str) -> datetime:
    return datetime.fromisoformat(text)


def long_run(line: Orchestrator, folder: Path, port: int, crashed: str) -> tuple[Any, str]:
    """An order on the served station, with a dwell that lasts; the station's configuration and the deployment."""
    config, name = modbus_station(port, limits=FAST), f"order-{crashed}"
    parameters = {"recipe": short_recipe_file(folder, 8.0), "station": str(station_file(folder, config))}
    deployed(line, folder, {"name": name, "parameters": parameters, "policy": {"crashed": crashed}})
    order(line, name)
    return config, name


def test_a_run_whose_computer_died_is_closed_by_the_server_within_a_minute(line: Orchestrator, tmp_path: Path) -> None:
    with station_served(lot_of(2)) as port:
        config, name = long_run(line, tmp_path, port, "close")
        with worker(line, tmp_path / "a") as process:
            line.until(lambda: [*tmp_path.glob("archive/captures/*/*/record.json")], "a record", 300.0)
            kill_all(process)
            killed = time.monotonic()
        line.until(lambda: safe(config), "the station is safe", 60.0)
        [run] = line.until(lambda: line.runs(name, "CRASHED"), "the run is closed", 150.0)
        took = time.monotonic() - killed
    assert took <= WITHIN_S, f"closed {took:.0f} s after its computer died"
    assert "no heartbeat for 60 s" in run["state"]["message"]
    assert any(entry["event"] == "watchdog_safe" for entry in read_log(tmp_path / "state"))


@pytest.fixture
def database() -> Iterator[Postgres]:
    with postgres() as cluster:
        yield cluster


def test_two_stations_measure_into_an_object_store_while_the_database_is_killed(
    database: Postgres, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in CREDENTIALS.items():
        monkeypatch.setenv(name, value)
    address, stations = tmp_path / "database", {"line-1": "simulated.toml", "line-2": "simulated-iai-espec.toml"}
    address.touch(0o600)
    address.write_text(database.address)
    with s3_bucket() as query:
        archive = f"s3://factory/archive?{query}"
        places = {"TUMBLELINE_ARCHIVE": archive, "TUMBLELINE_ORCHESTRATOR_DATABASE": str(address)}
        with served(tmp_path / "orchestrator", faultless=False, log_name="killed-database.log", **places) as line:
            recipe = recipe_file(tmp_path)
            wanted = [
                {"name": name, "work_pool": {"name": "line", "work_queue_name": name},
                 "parameters": {"recipe": recipe, "station": str(ROOT / "deploy" / "stations" / station)}}
                for name, station in stations.items()
            ]  # fmt: skip
            deployed(line, tmp_path, *wanted)
            with (
                worker(line, tmp_path / "a", "line-1", "host-a", tmp_path / "state-a"),
                worker(line, tmp_path / "b", "line-2", "host-b", tmp_path / "state-b"),
            ):
                for name in stations:
                    order(line, name)
                begun = ("RUNNING", "COMPLETED")
                line.until(lambda: all(line.runs(name, *begun) for name in stations), "both stations measure", 300.0)
                database.kill()
                time.sleep(3.0)
                database.start()
                line.until(lambda: all(line.runs(name, "COMPLETED") for name in stations), "both runs", 400.0)
            restored(database, tmp_path)
        assert not (tmp_path / "orchestrator" / "prefect.db").exists(), "the database is PostgreSQL"
        store = Archive(archive)
        assert [info.finished for info in store.runs()] == [True, True]
        assert verify(store, keys={}).whole


def restored(database: Postgres, folder: Path) -> None:
    """A dump restored into an empty database has the same flow runs; no password in a file that others may read."""
    dump = folder / "copies" / "orchestrator.dump"
    copy_database(database.address, dump)
    assert stat.S_IMODE(dump.stat().st_mode) == 0o600
    database.query("create database restored", "postgres")
    restore_database(dump, database.address.removesuffix("/prefect") + "/restored")
    count = "select state_type, count(*) from flow_run group by 1 order by 1"
    assert database.query(count, "restored") == database.query(count)
    assert "COMPLETED|2" in database.query(count, "restored")


def history(home: Path, query: str) -> list[tuple[str, ...]]:
    """Rows of the orchestrator's own database, read after its server has gone."""
    with closing(sqlite3.connect(f"file:{home / 'prefect.db'}?mode=ro", uri=True)) as database:
        return database.execute(query).fetchall()


def test_a_run_through_the_orchestrator_leaves_its_history_and_no_credentials_of_an_object_store(
    tmp_path: Path,
) -> None:
    user, secret = "AKIAQUITEUNLIKELY", "wJalrXUtnFEMIK7MDENG"
    with s3_bucket() as query:
        more = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "AWS_EC2_METADATA_DISABLED": "true"}
        more |= {"PREFECT_LOGGING_LEVEL": "DEBUG", "PREFECT_LOGGING_TO_API_ENABLED": "true"}
        address = f"s3://{user}:{secret}@factory/archive?{query}"
        done = tumbleline("run", recipe_file(tmp_path), "--archive", address, "--json", **more)
        assert done.returncode in {0, 1}, done.stderr
    [home] = (tmp_path / "cache" / "tumbleline").glob("orchestrator-*")
    assert sorted(history(home, "select name, state_type from task_run")) == sorted((n, "COMPLETED") for n in ORDER)
    assert history(home, "select state_type from flow_run") == [("COMPLETED",)]
    kept = [path for path in home.rglob("*") if path.is_file()]
    assert "prefect.db" in {path.name for path in kept}
    database = b"".join(path.read_bytes() for path in kept if path.name.startswith("prefect.db"))
    assert b"s3://factory/archive" in database  # the parameter, without its credentials
    for word in (user, secret):
        assert [str(path) for path in kept if word.encode() in path.read_bytes()] == []
        assert word not in done.stdout + done.stderr


def test_the_server_goes_when_its_last_user_has_gone(tmp_path: Path) -> None:
    home = tmp_path / "orchestrator"
    with local_server(home) as first:
        content = json.loads((home / "server.json").read_text(encoding="utf-8"))
        pid, key = content["pid"], content["key"]
        assert first["PREFECT_API_AUTH_STRING"] == key
        assert key.encode() not in Path(f"/proc/{pid}/cmdline").read_bytes()
        files = [home, *(path for path in home.iterdir() if path.is_file())]
        modes = {path.name: path.stat().st_mode & 0o077 for path in files}
        assert {"orchestrator", "server.json", "server.log", "prefect.db"} <= set(modes)
        assert {name for name, mode in modes.items() if mode} <= {"start.lock"}
        with local_server(home) as second:
            assert second["PREFECT_API_URL"] == first["PREFECT_API_URL"]
        assert Path(f"/proc/{pid}").exists()
    os.waitpid(pid, 0)
    assert not (home / "server.json").exists()


TWICE = """
import sys, time
from pathlib import Path
from pipelines.flows.local import reached
home = Path(sys.argv[1]) / "orchestrator"
for _ in range(2):
    with reached(home):
        from pipelines.flows.operator import waiting
        assert waiting() == []
    end = time.monotonic() + 60.0
    while (home / "server.json").exists() and time.monotonic() < end:
        time.sleep(0.1)
"""


def test_a_command_with_a_second_filling_reaches_a_server_again(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    python({**environment, "PYTHONPATH": str(ROOT)}, "-c", TWICE, str(tmp_path / "archive"))
