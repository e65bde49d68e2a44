"""An orchestrator as a line has it: the product's own server process with a key, on a free port; and what its log tells."""

import base64
import json
import os
import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Any

import pytest
from root_process import ROOT

from pipelines.orchestrator.settings import CLIENT_KEY, SERVER_KEY, new_key

PATIENCE_S = 120.0
BUSY_TIMES = 20
LOG = "server.log"
RECORD = re.compile(r"^(?=\d\d:\d\d:\d\d\.\d+ \| )", re.MULTILINE)
WRONG = re.compile(r"\A\S+ \|\s*(?:ERROR|CRITICAL)\s*\||^(?:ERROR|CRITICAL)\b|^Traceback ", re.MULTILINE)
BUSY = "sqlite3.OperationalError: database is locked"
"""Two services of the server wrote at once: SQLite refuses the second, which comes again within seconds."""


def errors_in(log: Path) -> str:
    """The first error of a server's log with what follows it; empty where there is none."""
    text = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
    wrong = [record for record in RECORD.split(text) if WRONG.search(record) and BUSY not in record]
    return wrong[0][:4000] if wrong else ""


@dataclass(frozen=True)
class Orchestrator:
    """A server that runs, and how to speak with it."""

    home: Path
    port: int
    key: str
    environment: dict[str, str]

    def ask(
        self, path: str, content: Any = None, method: str = "", key: str | None = None, **headers: str
    ) -> tuple[int, Any]:
        """Status and document of a request; ``key`` is the server's where None is given, and none where it is empty.

        A server that is busy (503) is asked again, as Prefect's clients do.
        """
        for _ in range(BUSY_TIMES):
            answer = self._ask(path, content, method, key, headers)
            if answer[0] != HTTPStatus.SERVICE_UNAVAILABLE:
                break
            time.sleep(0.5)
        return answer

    def _ask(self, path: str, content: Any, method: str, key: str | None, headers: dict[str, str]) -> tuple[int, Any]:
        used = self.key if key is None else key
        sent = {"Content-Type": "application/json"} | {name.replace("_", "-"): value for name, value in headers.items()}
        if used:
            sent["Authorization"] = "Basic " + base64.b64encode(used.encode()).decode()
        data = None if content is None else json.dumps(content).encode()
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}{path}", data, sent, method=method or None)
        try:
            with urllib.request.urlopen(request, timeout=30) as answer:
                return answer.status, _document(answer.read())
        except urllib.error.HTTPError as problem:
            with problem:
                return problem.code, _document(problem.read())
        except (TimeoutError, urllib.error.URLError) as problem:
            if isinstance(problem, urllib.error.URLError) and not isinstance(problem.reason, TimeoutError):
                raise
            return HTTPStatus.SERVICE_UNAVAILABLE, "no answer within 30 s"

    def runs(self, deployment: str, *states: str) -> list[dict]:
        """Flow runs of a deployment in one of the states."""
        wanted = {
            "flow_runs": {"state": {"type": {"any_": list(states)}}} if states else {},
            "deployments": {"name": {"any_": [deployment]}},
            "sort": "EXPECTED_START_TIME_ASC",
        }
        status, flow_runs = self.ask("/api/flow_runs/filter", wanted)
        assert status == 200, flow_runs
        return flow_runs

    def until(self, condition: Any, what: str, patience_s: float = PATIENCE_S) -> Any:
        """What ``condition`` gives as soon as it gives anything."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            if result := condition():
                return result
            time.sleep(0.5)
        raise AssertionError(f"{what}: not within {patience_s:g} s; log: {errors_in(self.home / LOG)}")


def _document(data: bytes) -> Any:
    try:
        return json.loads(data)
    except ValueError:
        return data.decode(errors="replace")


@contextmanager
def served(home: Path, *, faultless: bool = True, log_name: str = LOG, **settings: str) -> Iterator[Orchestrator]:
    """The server of a line, with its history in ``home``; an error in its log fails at the end where it is ``faultless``."""
    home.mkdir(parents=True, exist_ok=True)
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    key = new_key()
    common = {
        **os.environ, "PREFECT_HOME": str(home), "PREFECT_LOGGING_COLORS": "false", "PYTHONPATH": str(ROOT),
        "PREFECT_SERVER_ALLOW_EPHEMERAL_MODE": "false", **settings,
    }  # fmt: skip
    command = [sys.executable, "-m", "pipelines.orchestrator.server", "--port", str(port)]
    with (home / log_name).open("ab") as log:
        process = subprocess.Popen(command, cwd=ROOT, env={**common, SERVER_KEY: key}, stdout=log, stderr=log)
    client = {**common, "PREFECT_API_URL": f"http://127.0.0.1:{port}/api", CLIENT_KEY: key}
    orchestrator = Orchestrator(home, port, key, client)
    try:
        orchestrator.until(lambda: _answers(orchestrator, process), "the server answers")
        yield orchestrator
    finally:
        process.terminate()
        process.wait(60)
    assert not (faultless and errors_in(home / log_name)), errors_in(home / log_name)


@contextmanager
def client_of(server: Orchestrator) -> Iterator[None]:
    """This process as a client of a server."""
    from prefect.settings import temporary_settings

    own = {name: server.environment[name] for name in ("PREFECT_API_URL", CLIENT_KEY, "PREFECT_HOME")}
    with pytest.MonkeyPatch.context() as patch, temporary_settings(updates=own):
        for name, value in own.items():
            patch.setenv(name, value)
        yield


def _answers(orchestrator: Orchestrator, process: subprocess.Popen[bytes]) -> bool:
    assert process.poll() is None, "the server has ended"
    try:
        return orchestrator.ask("/api/health", key="")[0] == 200
    except OSError:
        return False
