"""A line for slow tests: deployments with pieces replaced, workers as several computers would have them, and how to kill them."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil
import yaml
from orchestrator import Orchestrator
from root_process import ROOT

from pipelines.orchestrator.settings import CLIENT_KEY

QUERY_S = "2"


def deployments(folder: Path, wanted: list[dict[str, Any]], name: str = "prefect.yaml") -> str:
    """A file with the product's first deployment, once with each set of changes."""
    content = yaml.safe_load((ROOT / "deploy" / "prefect.yaml").read_text(encoding="utf-8"))
    base = content["deployments"][0] | {"schedules": []}
    path = folder / name
    path.write_text(yaml.safe_dump(content | {"deployments": [base | one for one in wanted]}), encoding="utf-8")
    return str(path)


@contextmanager
def worker(
    line: Orchestrator, folder: Path, station: str = "line-1", host: str = "host-a", state: Path | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """The product's worker with its key in a file, as a service has it; told to end with the block unless it is dead."""
    folder.mkdir(parents=True, exist_ok=True)
    key = folder / "prefect-auth"
    key.touch(0o600)
    key.write_text(line.key)
    environment = {name: value for name, value in line.environment.items() if name != CLIENT_KEY}
    environment |= {"CREDENTIALS_DIRECTORY": str(folder), "PREFECT_WORKER_QUERY_SECONDS": QUERY_S}
    environment |= {} if state is None else {"TUMBLELINE_STATE": str(state)}
    command = [sys.executable, "-m", "pipelines.orchestrator.worker", "start", "--station", station]
    command += ["--host", host] if host else []
    with (
        (folder / "worker.log").open("ab") as out,
        subprocess.Popen(command, cwd=ROOT, env=environment, stdout=out, stderr=out) as process,
    ):
        try:
            yield process
        finally:
            if process.poll() is None:
                process.terminate()
            process.wait(180)


def kill_all(process: subprocess.Popen[bytes]) -> int:
    """Kill a worker and what it started, but no watchdog, as a crash of its service would; number of processes."""
    family = [psutil.Process(process.pid)]
    with suppress(psutil.NoSuchProcess):
        family += family[0].children(recursive=True)
    killed = 0
    for one in family:
        with suppress(psutil.NoSuchProcess):
            if "stations.watchdog" not in " ".join(one.cmdline()):
                os.kill(one.pid, signal.SIGKILL)
                killed += 1
    process.wait(30)
    return killed


def order(line: Orchestrator, deployment: str, **parameters: Any) -> dict[str, Any]:
    """A run of a deployment that a person ordered."""
    _, deployed = line.ask(f"/api/deployments/name/calibrate_lot/{deployment}")
    status, run = line.ask(f"/api/deployments/{deployed['id']}/create_flow_run", {"parameters": parameters})
    assert status == 201, run
    return run
