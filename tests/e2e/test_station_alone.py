"""One station, one run at a time, whoever orders it; and what becomes of a run whose processes are killed."""

import shutil
import time
from collections.abc import Iterator
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import pytest
from capture_double import recipe_file
from lines import deployments, kill_all, order, worker
from orchestrator import Orchestrator, served
from root_process import ROOT, python
from served_station import modbus_station, station_file
from served_station import served as station_served
from small_station import lot_of
from test_worker import FAST, LONG_DWELLS

from pipelines.archive import Archive
from stations.opening import open_devices
from stations.safety.folder import read_log

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

MINUTELY = [{"cron": "* * * * *", "timezone": "UTC"}]
WITHIN_S = 60.0 + 15.0
"""A minute without a heartbeat, and the steps of the server's own services (5 s each)."""


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Orchestrator]:
    places = {"TUMBLELINE_ARCHIVE": str(tmp_path / "archive"), "TUMBLELINE_STATE": str(tmp_path / "state")}
    with served(tmp_path / "orchestrator", **places) as server:
        yield server


def test_schedules_and_persons_on_two_computers_get_the_station_one_after_the_other(
    line: Orchestrator, tmp_path: Path
) -> None:
    """Two deployments every minute, orders beside them, two workers on one queue: no two runs overlap."""
    recipe = {"parameters": {"recipe": recipe_file(tmp_path)}}
    wanted = [recipe | {"name": name, "schedules": MINUTELY, "concurrency_limit": 1} for name in ("early", "late")]
    python(
        line.environment, "-m", "pipelines.flows.deploy", deployments(tmp_path, [*wanted, recipe | {"name": "hand"}])
    )
    with (
        worker(line, tmp_path / "a", host="host-a"),
        worker(line, tmp_path / "b", host="host-b", state=tmp_path / "state-b"),
    ):
        for _ in range(3):
            order(line, "hand", recipe=recipe["parameters"]["recipe"])
        line.until(lambda: len(done(line)) >= 4 and len(line.runs("hand", "COMPLETED")) == 3, "four runs", 800.0)
    spans = sorted(done(line))
    overlaps = [(one, other) for one, other in pairwise(spans) if other[0] < one[1]]
    assert overlaps == []
    assert len(Archive(tmp_path / "archive").runs()) >= 4
    assert "is driven by" not in (tmp_path / "a" / "worker.log").read_text(), (
        "the queue, not the lease, keeps them apart"
    )


def done(line: Orchestrator) -> list[tuple[datetime, datetime, str]]:
    """Start, end and deployment of the finished runs."""
    names = ("early", "late", "hand")
    runs = [(name, run) for name in names for run in line.runs(name, "COMPLETED")]
    return [(when(run["start_time"]), when(run["end_time"]), name) for name, run in runs]


def when(text: str) -> datetime:
    return datetime.fromisoformat(text)


def long_run(line: Orchestrator, folder: Path, port: int, crashed: str) -> tuple[object, str]:
    """An order on the served station, with a dwell that lasts; the station's configuration and the deployment."""
    shutil.copy(ROOT / "deploy" / "recipes" / "line-quick.limits.toml", folder)
    changes = [change for change in LONG_DWELLS if change[0] != "dwell_s = 1.0"]
    recipe = recipe_file(folder, *changes, ("dwell_s = 1.0", "dwell_s = 8.0"))
    config = modbus_station(port, limits=FAST)
    parameters = {"recipe": recipe, "station": str(station_file(folder, config))}
    name = f"order-{crashed}"
    wanted = [{"name": name, "parameters": parameters, "policy": {"crashed": crashed}}]
    python(line.environment, "-m", "pipelines.flows.deploy", deployments(folder, wanted))
    order(line, name)
    return config, name


def records(folder: Path) -> dict[str, int]:
    """Finished records of the captures of an archive, with the time at which each was published."""
    files = (folder / "archive" / "captures").glob("*/*/record.json")
    return {f"{path.parent.parent.name}/{path.parent.name}": path.stat().st_mtime_ns for path in files}


def test_a_run_whose_worker_was_killed_goes_on_from_its_checkpoint(line: Orchestrator, tmp_path: Path) -> None:
    with station_served(lot_of(2)) as port:
        config, name = long_run(line, tmp_path, port, "continue")
        with worker(line, tmp_path / "a") as process:
            line.until(lambda: len(records(tmp_path)) >= 2, "two records", 300.0)
            assert kill_all(process) >= 3  # first process, worker of Prefect, flow
        before = records(tmp_path)
        line.until(lambda: safe(config), "the station is safe", 60.0)
        killed = time.monotonic()
        with worker(line, tmp_path / "a"):
            line.until(lambda: line.runs(name, "RUNNING", "PENDING", "SCHEDULED"), "the run goes on", 120.0)
            [run] = line.until(lambda: line.runs(name, "COMPLETED"), "the run is complete", 500.0)
        assert time.monotonic() - killed < 500.0
    assert run["run_count"] == 2
    after = records(tmp_path)
    assert {record: after[record] for record in before} == before, "finished records were not measured again"
    assert len(after) > len(before)
    [info] = Archive(tmp_path / "archive").runs()
    assert info.finished


def test_a_run_whose_computer_died_is_closed_by_the_server_within_a_minute(line: Orchestrator, tmp_path: Path) -> None:
    with station_served(lot_of(2)) as port:
        config, name = long_run(line, tmp_path, port, "close")
        with worker(line, tmp_path / "a") as process:
            line.until(lambda: len(records(tmp_path)) >= 1, "a record", 300.0)
            kill_all(process)
            killed = time.monotonic()
        line.until(lambda: safe(config), "the station is safe", 60.0)
        [run] = line.until(lambda: line.runs(name, "CRASHED"), "the run is closed", 150.0)
        took = time.monotonic() - killed
    assert took <= WITHIN_S, f"closed {took:.0f} s after its computer died"
    assert "no heartbeat for 60 s" in run["state"]["message"]
    assert any(entry["event"] == "watchdog_safe" for entry in read_log(tmp_path / "state"))


def safe(config: object) -> bool:
    with open_devices(config, ()) as devices:
        return devices.chamber.set_point() == 25.0 and devices.reader.sampling() == "stopped"
