"""The audit as a deployment: a worker runs it, and its findings are artifacts of the orchestrator."""

import json
import os
import sqlite3
import sys
from contextlib import closing

import pytest
from root_process import ROOT, python

sys.path.insert(0, str(ROOT))

from benchmarks.generated_archive import write_archive
from pipelines.flows.local import local_server


@pytest.mark.slow
def test_the_weekly_audit_leaves_its_findings_as_artifacts(tmp_path):
    archive, pages, home = tmp_path / "archive", tmp_path / "pages", tmp_path / "orchestrator"
    write_archive(archive, 16, years=1.0, seed=5, workers=1)
    with local_server(home) as address:
        environment = {**os.environ, **address, "PYTHONPATH": str(ROOT)}
        python(environment, "-m", "prefect", "work-pool", "create", "line", "--type", "process")
        names = python(environment, "-m", "pipelines.flows.deploy", "deploy/prefect.yaml").split()
        parameters = json.dumps({"archive": str(archive), "pages": str(pages), "until": "2023-12-31"})
        python(environment, "-m", "prefect", "deployment", "run", "audit_archive/weekly-audit", "--params", parameters)
        python(environment, "-m", "prefect", "worker", "start", "--pool", "line", "--run-once", "--limit", "1")
        schedules = python(environment, "-m", "prefect", "deployment", "schedule", "ls", "audit_archive/weekly-audit")
    assert "audit_archive/weekly-audit" in names
    assert "0 5 * * 1" in schedules
    with closing(sqlite3.connect(f"file:{home / 'prefect.db'}?mode=ro", uri=True)) as database:
        artifacts = dict(database.execute("select key, data from artifact where key is not null").fetchall())
        states = database.execute("select state_type from flow_run where state_type != 'SCHEDULED'").fetchall()
    database.close()
    assert states == [("COMPLETED",)]
    document = json.loads((pages / "audit-2023-12-31.json").read_text(encoding="utf-8"))
    told = [finding["message"] for finding in document["findings"]]
    assert told
    table = json.loads(json.loads(artifacts["tumbleline-audit"]))
    assert [row["finding"] for row in table] == told
    assert "# Audit until 2023-12-31" in artifacts["tumbleline-audit-summary"]
    assert "<svg" in (pages / "audit-2023-12-31.html").read_text(encoding="utf-8")
