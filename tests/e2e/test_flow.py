"""The flow through a real server: its history complete, and a deployment that a worker runs into the archive."""

import json
import os
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from capture_double import recipe_file
from root_process import ROOT, python

from pipelines.archive import Archive
from pipelines.chain.chain import ORDER
from pipelines.flows.local import local_server


def history(home: Path, query: str) -> list[tuple[str, ...]]:
    """Rows of the orchestrator's own database, read after its server has gone."""
    import sqlite3

    with closing(sqlite3.connect(f"file:{home / 'prefect.db'}?mode=ro", uri=True)) as database:
        rows = database.execute(query).fetchall()
    database.close()
    return rows


@pytest.mark.slow
def test_a_run_through_the_orchestrator_leaves_its_whole_history(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "pipelines.cli",
        "run",
        recipe_file(tmp_path),
        "--json",
        "--archive",
        str(tmp_path / "archive"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode in (0, 1), done.stderr
    document = json.loads(done.stdout)
    assert Path(document["report"]).is_file()
    rows = history(tmp_path / "archive" / "orchestrator", "select name, state_type from task_run")
    assert sorted(rows) == sorted((name, "COMPLETED") for name in ORDER)
    assert history(tmp_path / "archive" / "orchestrator", "select state_type from flow_run") == [("COMPLETED",)]


@pytest.mark.slow
def test_a_deployment_started_by_hand_appears_in_the_archive(tmp_path: Path) -> None:
    archive = tmp_path / "archive"
    recipe = recipe_file(tmp_path)
    with local_server(tmp_path / "orchestrator") as address:
        environment = {**os.environ, **address, "PYTHONPATH": str(ROOT)}
        python(environment, "-m", "prefect", "work-pool", "create", "line", "--type", "process")
        names = python(environment, "-m", "pipelines.flows.deploy", "deploy/prefect.yaml").split()
        parameters = json.dumps({"recipe": recipe, "archive": str(archive), "units": ["S1", "S2"]})
        python(environment, "-m", "prefect", "deployment", "run", "calibrate_lot/on-demand", "--params", parameters)
        python(environment, "-m", "prefect", "worker", "start", "--pool", "line", "--run-once", "--limit", "1")
        schedules = python(
            environment, "-m", "prefect", "deployment", "schedule", "ls", "calibrate_lot/production-line"
        )
    assert names == ["calibrate_lot/production-line", "calibrate_lot/on-demand", "audit_archive/weekly-audit"]
    assert "0 6 * * 1-5" in schedules
    [info] = Archive(archive).runs()
    assert info.finished
    assert info.units == ("S1", "S2")
    wanted = history(tmp_path / "orchestrator", "select state_type from flow_run where state_type != 'SCHEDULED'")
    assert wanted == [("COMPLETED",)]


@pytest.mark.slow
def test_the_server_goes_when_its_last_user_has_gone(tmp_path: Path) -> None:
    home = tmp_path / "orchestrator"
    with local_server(home) as first:
        content = json.loads((home / "server.json").read_text(encoding="utf-8"))
        pid, key = content["pid"], content["key"]
        assert first["PREFECT_API_AUTH_STRING"] == key
        assert key.encode() not in Path(f"/proc/{pid}/cmdline").read_bytes()
        modes = {
            path.name: path.stat().st_mode & 0o077 for path in (home, *home.iterdir()) if path.is_file() or path == home
        }
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
from pipelines.archive import Archive
from pipelines.flows.local import reached
for _ in range(2):
    with reached(Archive(sys.argv[1])):
        from pipelines.flows.operator import waiting
        assert waiting() == []
    end = time.monotonic() + 60.0
    while (Path(sys.argv[1]) / "orchestrator" / "server.json").exists() and time.monotonic() < end:
        time.sleep(0.1)
"""


@pytest.mark.slow
def test_a_command_with_a_second_filling_reaches_a_server_again(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    python({**environment, "PYTHONPATH": str(ROOT)}, "-c", TWICE, str(tmp_path / "archive"))
