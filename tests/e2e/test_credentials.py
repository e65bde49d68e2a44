"""An archive in an object store whose address holds credentials: none of them is in the orchestrator's files."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from capture_double import recipe_file
from root_process import ROOT
from s3_server import s3_bucket

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

USER, SECRET = "AKIAQUITEUNLIKELY", "wJalrXUtnFEMIK7MDENG"


def test_a_run_through_the_orchestrator_stores_no_credentials(tmp_path: Path) -> None:
    with s3_bucket() as query:
        address = f"s3://{USER}:{SECRET}@factory/archive?{query}"
        environment = {name: value for name, value in os.environ.items() if not name.startswith("AWS_")}
        environment |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), "AWS_EC2_METADATA_DISABLED": "true"}
        environment |= {"PREFECT_LOGGING_LEVEL": "DEBUG", "PREFECT_LOGGING_TO_API_ENABLED": "true"}
        command = [sys.executable, "-m", "pipelines.cli", "run", recipe_file(tmp_path), "--archive", address, "--json"]
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=400, check=False
        )
        assert done.returncode in {0, 1}, done.stderr
        assert json.loads(done.stdout)["units"]
    homes = list((tmp_path / "cache" / "tumbleline").glob("orchestrator-*"))
    assert len(homes) == 1
    kept = [path for path in homes[0].rglob("*") if path.is_file()]
    assert "prefect.db" in {path.name for path in kept}
    database = b"".join(path.read_bytes() for path in kept if path.name.startswith("prefect.db"))
    assert b"s3://factory/archive" in database  # the parameter, without its credentials
    for word in (USER, SECRET):
        assert [str(path) for path in kept if word.encode() in path.read_bytes()] == []
        assert word not in done.stdout + done.stderr
