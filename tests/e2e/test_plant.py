"""A plant on loopback: PostgreSQL, an object store, the key, two workers beside two stations; the database killed in between."""

import stat
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from capture_double import recipe_file
from lines import deployments, order, worker
from orchestrator import Orchestrator, served
from postgres_server import Postgres, postgres
from root_process import ROOT, python
from s3_server import CREDENTIALS, s3_bucket

from pipelines.archive import Archive
from pipelines.integrity.archive import verify
from pipelines.orchestrator.database import copy_database, restore_database

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture
def database() -> Iterator[Postgres]:
    with postgres() as cluster:
        yield cluster


def test_two_stations_measure_into_an_object_store_while_the_database_is_killed(
    database: Postgres, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in CREDENTIALS.items():
        monkeypatch.setenv(name, value)
    address = tmp_path / "database"
    address.touch(0o600)
    address.write_text(database.address)
    with s3_bucket() as query:
        archive = f"s3://factory/archive?{query}"
        places = {"TUMBLELINE_ARCHIVE": archive, "TUMBLELINE_ORCHESTRATOR_DATABASE": str(address)}
        with served(tmp_path / "orchestrator", faultless=False, log_name="killed-database.log", **places) as line:
            recipe = recipe_file(tmp_path)
            stations = {"line-1": "simulated.toml", "line-2": "simulated-iai-espec.toml"}
            wanted = [
                {"name": name, "work_pool": {"name": "line", "work_queue_name": name},
                 "parameters": {"recipe": recipe, "station": str(ROOT / "deploy" / "stations" / station)}}
                for name, station in stations.items()
            ]  # fmt: skip
            python(line.environment, "-m", "pipelines.flows.deploy", deployments(tmp_path, wanted))
            with (
                worker(line, tmp_path / "a", "line-1", "host-a", tmp_path / "state-a"),
                worker(line, tmp_path / "b", "line-2", "host-b", tmp_path / "state-b"),
            ):
                for name in stations:
                    order(line, name)
                line.until(lambda: running(line, stations), "both stations measure", 300.0)
                database.kill()
                time.sleep(3.0)
                database.start()
                line.until(lambda: all(line.runs(name, "COMPLETED") for name in stations), "both runs", 400.0)
            restored(database, tmp_path)
        assert not (tmp_path / "orchestrator" / "prefect.db").exists(), "the database is PostgreSQL"
        store = Archive(archive)
        infos = store.runs()
        assert len(infos) == 2
        assert all(info.finished for info in infos)
        assert verify(store, keys={}).whole


def running(line: Orchestrator, names: dict[str, str]) -> bool:
    """Whether each station has a run that has started."""
    return all(line.runs(name, "RUNNING", "COMPLETED") for name in names)


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
