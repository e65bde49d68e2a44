"""A run through an orchestrator that needs no set-up: its server is started beside the archive and shared."""

import json
import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
import uuid
from collections.abc import Callable, Generator
from contextlib import contextmanager
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

from pipelines.archive import Archive, Run, code_hash
from pipelines.archive.files import ELSEWHERE, TEMPORARY, publish, writing
from pipelines.chain.attendance import Operator
from pipelines.chain.chain import BY_NAME, ORDER
from pipelines.chain.runner import Done
from pipelines.jobs.job import Job, Request
from pipelines.orchestrator.archive_address import named, without_credentials
from pipelines.orchestrator.server import ADDRESS, CLIENTS, START_LOCK, private_folder, quick_imports
from pipelines.orchestrator.settings import (
    CLIENT_KEY,
    KEY_FILE,
    STARTUP_S,
    cache_folder,
    check_server,
    new_key,
    settings,
    use_key,
)
from pipelines.parallel import with_environment
from pipelines.schedule.steps import steps
from schemas import host
from schemas.errors import ArchiveUnusable, LinkLost, StationTimeout, TumblelineError
from schemas.installed import missing_in
from schemas.progress import Progress

POLL_S = 0.1
PRIVATE = 0o600
PROBE = f"{TEMPORARY}database"
DATABASE_BYTES = 2**21  # a new database has 1.6 MB after its first run
NEEDED = (
    "pipelines.flows.calibrate",
    "pipelines.orchestrator.dead_runs",
    "prefect.flow_engine",
    "pipelines.capture.capture",
    "pipelines.jobs.adequacy",
    "pipelines.jobs.references",
    "pipelines.report",
    "stations.opening",
)
SIMULATED = ("stations.plant.plant", "stations.plant.server")
"""Modules that a run imports, and those of a simulated station: the slow ones."""

_started: list[
    subprocess.Popen[bytes]
] = []  # they end by themselves; referenced so that the interpreter does not warn of them


def run_locally(
    request: Request,
    job: Job,
    archive: Archive,
    progress: Progress,
    report: Callable[[Done], None],
    operator: Operator | None,
) -> Run:
    """The run that the flow ``calibrate_lot`` made, on the server named by PREFECT_API_URL or on one of our own."""
    archive.prepare()
    progress(0, len(steps(job.recipe)), "starting the orchestrator")
    name = f"{job.recipe.name} {job.capture_id}"
    with flow_run(archive, name, lambda: _prepare(job)) as address:
        from pipelines.flows.calibrate import calibrate_lot, listeners, with_last

        with with_last(listeners, (progress, report, operator)):
            flow = calibrate_lot.with_options(flow_run_name=name)
            run_id = str(flow(**request.parameters(), archive=address))
    return archive.run(run_id)


@contextmanager
def flow_run(archive: Archive, name: str, meanwhile: Callable[[], None] = lambda: None) -> Generator[str]:
    """A block for one flow run of a name, with the address by which it finds an archive; its history is complete at the end."""
    with reached(_home(archive), meanwhile), _answering():
        from pipelines.flows.calibrate import settle_history
        from pipelines.orchestrator.dead_runs import close_dead_runs

        close_dead_runs(name)
        with named(archive) as address:
            yield address
        settle_history(name, len(ORDER))


@contextmanager
def _answering() -> Generator[None]:
    """A block whose orchestrator may end, or no longer write its database: the user is told what to do."""
    from httpx import HTTPStatusError, TransportError

    try:
        yield
    except (TransportError, HTTPStatusError) as problem:
        fault = f"no longer answers ({problem}), a running server is needed; start it"
        if isinstance(problem, HTTPStatusError):
            if not problem.response.is_server_error:
                raise
            fault = "answers with a fault of its own, as where the disk of its database is full; make room"
        address = os.environ["PREFECT_API_URL"]
        raise LinkLost(f"orchestrator: {address} {fault}, and give the command again to continue") from None


def _prepare(job: Job) -> None:
    """Import what the run needs and read the sources of its stages, while the server starts on another processor."""
    with quick_imports():
        for name in (*NEEDED, *(SIMULATED if job.station.simulation is not None else ())):
            import_module(name)
    for name in (*BY_NAME, "report"):
        code_hash(name)  # the hash is cached


@contextmanager
def reached(home: Path, meanwhile: Callable[[], None] = lambda: None) -> Generator[None]:
    """A block in which an orchestrator answers: that named by PREFECT_API_URL, or a server of this process in folder ``home``.

    ``meanwhile`` is called while a server of our own starts. This process is its client; the environment is restored afterwards.
    """
    if os.environ.get("PREFECT_API_URL"):
        reach_named()
        yield
        return
    with local_server(home, meanwhile) as environment, with_environment(environment):
        from prefect.settings import temporary_settings

        # Prefect reads the environment when it is imported, which an earlier block may have done for another server
        updates: dict[Any, str] = {name: environment[name] for name in ("PREFECT_API_URL", "PREFECT_HOME", CLIENT_KEY)}
        with temporary_settings(updates=updates):
            yield


def reach_named() -> None:
    """Make sure that the orchestrator named by PREFECT_API_URL answers to our key; Prefect's cloud has other keys."""
    if os.environ.get(KEY_FILE) and not os.environ.get(CLIENT_KEY):
        use_key(CLIENT_KEY)
    if not os.environ.get("PREFECT_API_KEY"):
        check_server()


def _home(archive: Archive) -> Path:
    """Folder of the server of an archive: in the archive, or in the user's cache where the archive is an object store."""
    if isinstance(archive.root, Path):
        return archive.root.resolve() / "orchestrator"
    return cache_folder() / f"orchestrator-{sha256(without_credentials(archive.address).encode()).hexdigest()[:16]}"


@contextmanager
def local_server(home: Path, meanwhile: Callable[[], None] = lambda: None) -> Generator[dict[str, str], None, None]:
    """The environment of a server that runs at least as long as this block; several processes can share it."""
    _refuse_foreign(home)
    private_folder(home)
    private_folder(home / CLIENTS)
    client = home / CLIENTS / f"{os.getpid()}-{uuid.uuid4().hex[:8]}"
    with client.open("w") as held:
        host.lock(held, host.SHARED)
        with (home / START_LOCK).open("w") as lock:
            host.lock(lock, host.EXCLUSIVE)
            port, key = _running(home) or _start(home, meanwhile)
        try:
            yield settings(home, port, key)
        finally:
            client.unlink(missing_ok=True)


def environment_of(archive: Archive) -> dict[str, str]:
    """The environment of the server that runs beside an archive; empty where none runs."""
    home = _home(archive)
    running = _running(home)
    return settings(home, *running) if running else {}


def _refuse_foreign(home: Path) -> None:
    """Refuse the folder of another user's server: its key is that user's alone."""
    if home.exists() and host.user_id() not in {home.stat().st_uid, 0}:
        raise ArchiveUnusable(
            f"orchestrator: {home} belongs to another user (id {home.stat().st_uid}), whose server is private; name an "
            "orchestrator of the line in PREFECT_API_URL, or run with --direct"
        )


def _running(home: Path) -> tuple[int, str] | None:
    """Port and key of a server that answers; None where there is none."""
    try:
        content = json.loads((home / ADDRESS).read_text(encoding="utf-8"))
        port, key = int(content["port"]), str(content["key"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return (port, key) if _answers(port) else None


def _start(home: Path, meanwhile: Callable[[], None]) -> tuple[int, str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port, key = int(probe.getsockname()[1]), new_key()
    log_path = home / "server.log"
    before = log_path.stat().st_size if log_path.exists() else 0
    with os.fdopen(_private_file(log_path, os.O_APPEND), "ab") as log:
        process = subprocess.Popen(  # noqa: S603 - our own module, by our own interpreter
            [sys.executable, "-m", "pipelines.orchestrator.server", "--port", str(port), "--until-unused", str(home)],
            # the key in the environment: the arguments of a process are there for everybody to read
            env={**os.environ, **settings(home, port, key), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    _started.append(process)
    with with_environment(settings(home, port, key)):  # Prefect reads it when it is imported
        meanwhile()
    end = time.monotonic() + STARTUP_S
    while not _answers(port):
        if process.poll() is not None or time.monotonic() > end:
            missing = missing_in(log_path.read_bytes()[before:].decode("utf-8", errors="replace"))
            if missing is not None:
                raise TumblelineError(f"orchestrator: {missing}")
            publish(home / PROBE, bytes(DATABASE_BYTES))  # refuses a full disk, where a log has no room for the reason
            (home / PROBE).unlink()
            status = process.poll()
            found = f"does not answer after {STARTUP_S} s" if status is None else f"ended with status {status}"
            raise StationTimeout(f"orchestrator: its server {found}; read {log_path}, or run with --direct")
        time.sleep(POLL_S)
    with (
        writing(home / ADDRESS, "orchestrator", ELSEWHERE),
        os.fdopen(_private_file(home / ADDRESS, os.O_TRUNC), "w", encoding="utf-8") as file,
    ):
        json.dump({"port": port, "pid": process.pid, "key": key}, file)
    return port, key


def _private_file(path: Path, how: int) -> int:
    """A file opened for writing that only this user may read."""
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | how, PRIVATE)
    os.fchmod(handle, PRIVATE)  # one of an older version is there with another mode
    return handle


def _answers(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/health", timeout=2.0) as answer:
            return answer.status == 200
    except (urllib.error.URLError, TimeoutError, ConnectionError):
        return False
