"""A run through an orchestrator that needs no set-up: its server is started beside the archive and shared."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
import uuid
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.chain.chain import ORDER
from pipelines.flows.settings import STARTUP_S, settings
from schemas.errors import StationTimeout

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from pipelines.archive import Archive, Run
    from pipelines.chain.attendance import Operator
    from pipelines.chain.runner import Done
    from pipelines.jobs.job import Job, Request
    from schemas.progress import Progress

POLL_S = 0.1
CLIENTS, START_LOCK, ADDRESS = "clients", "start.lock", "server.json"

_started: list[subprocess.Popen[bytes]] = []  # they end by themselves; kept so that the interpreter does not complain


def run_locally(
    request: Request,
    job: Job,
    archive: Archive,
    progress: Progress,
    told: Callable[[Done], None],
    operator: Operator | None = None,
) -> Run:
    """The run that the flow ``calibrate_lot`` made, on the server named by PREFECT_API_URL or on one of our own."""
    archive.prepare()
    progress(0, job.recipe.wanted_records, "starting the orchestrator")
    with reached(archive):
        return _run(request, job, archive, progress, told, operator)


@contextmanager
def reached(archive: Archive) -> Generator[None]:
    """A block in which an orchestrator answers: the one named by PREFECT_API_URL, or one of our own beside the archive."""
    if os.environ.get("PREFECT_API_URL"):
        yield
        return
    with local_server(_home(archive)) as environment:
        os.environ.update(environment)
        yield


def _home(archive: Archive) -> Path:
    """Where the server of an archive keeps what it needs: in its folder, or with the user where that is an object store."""
    if isinstance(archive.root, Path):
        return archive.root.resolve() / "orchestrator"
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "tumbleline" / f"orchestrator-{sha256(archive.address.encode()).hexdigest()[:16]}"


def _run(
    request: Request,
    job: Job,
    archive: Archive,
    progress: Progress,
    told: Callable[[Done], None],
    operator: Operator | None,
) -> Run:
    from pipelines.flows.calibrate import calibrate_lot, close_dead_runs, listening, settle_history

    name = f"{job.recipe.name} {job.capture_id}"
    close_dead_runs(name)
    with listening(progress, told, operator):
        named = calibrate_lot.with_options(flow_run_name=name)
        run_id = str(named(**request.parameters(), archive=archive.address))
    settle_history(name, len(ORDER))
    return archive.run(run_id)


@contextmanager
def local_server(home: Path) -> Generator[dict[str, str], None, None]:
    """The environment of a server that runs for as long as this block, shared with others who want it."""
    (home / CLIENTS).mkdir(parents=True, exist_ok=True)
    client = home / CLIENTS / f"{os.getpid()}-{uuid.uuid4().hex[:8]}"
    with client.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_SH)
        with (home / START_LOCK).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            port = _running(home) or _start(home)
        try:
            yield settings(home, port)
        finally:
            client.unlink(missing_ok=True)


def environment_of(archive: Archive) -> dict[str, str]:
    """The environment of the server that runs beside an archive; nothing where none does."""
    home = _home(archive)
    port = _running(home)
    return settings(home, port) if port else {}


def _running(home: Path) -> int:
    """Port of a server that answers; 0 where there is none."""
    try:
        port = int(json.loads((home / ADDRESS).read_text(encoding="utf-8"))["port"])
    except (OSError, ValueError, KeyError):
        return 0
    return port if _answers(port) else 0


def _start(home: Path) -> int:
    port = _free_port()
    with (home / "server.log").open("ab") as log:
        process = subprocess.Popen(  # noqa: S603 - our own module, by our own interpreter
            [sys.executable, "-m", "pipelines.flows.server", str(home), str(port)],
            env={**os.environ, **settings(home, port), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    _started.append(process)
    end = time.monotonic() + STARTUP_S
    while not _answers(port):
        if process.poll() is not None or time.monotonic() > end:
            raise StationTimeout(
                f"orchestrator: its server does not answer after {STARTUP_S} s (status {process.poll()}); look into "
                f"{home / 'server.log'}, or run with --direct"
            )
        time.sleep(POLL_S)
    (home / ADDRESS).write_text(json.dumps({"port": port, "pid": process.pid}), encoding="utf-8")
    return port


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _answers(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/health", timeout=2.0) as answer:
            return answer.status == 200
    except (urllib.error.URLError, TimeoutError, ConnectionError):
        return False
