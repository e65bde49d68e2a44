"""A run that the server calls crashed is not started a second time beside its own process."""

import os
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from prefect.client.schemas.objects import StateType

from pipelines.orchestrator import dead_runs, queue_rules

NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)


class Client:
    """A client of the server with one crashed run; it keeps what was scheduled."""

    def __init__(self) -> None:
        self.scheduled: list[str] = []

    def read_flow_run_states(self, _run: str) -> list[Any]:
        return [SimpleNamespace(type=StateType.CRASHED)]

    def read_flow_run(self, _run: str) -> Any:
        return SimpleNamespace(state_type=StateType.CRASHED)

    def set_flow_run_state(self, run: str, _state: Any, *, force: bool) -> None:
        assert force
        self.scheduled.append(run)


@pytest.mark.skipif(sys.platform != "linux", reason="processes are recognised by /proc")
def test_a_crashed_run_whose_process_lives_is_not_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    words = [sys.executable, "-c", "import time; time.sleep(60)"]
    process = subprocess.Popen(words, env={**os.environ, "PREFECT__FLOW_RUN_ID": "run-1"})
    state = SimpleNamespace(timestamp=NOW - timedelta(minutes=2))
    run = SimpleNamespace(
        id="run-1", name="a-run", tags=["crashed=continue"], infrastructure_pid=str(process.pid), state=state
    )
    monkeypatch.setattr(queue_rules, "runs_of_queue", lambda *_: [run])
    client = Client()
    try:
        assert queue_rules._continue_crashed(client, "pool", "line-1", NOW, queue_rules.SETTLED) == []
        assert client.scheduled == []
    finally:
        process.kill()
        process.wait()
    [text] = queue_rules._continue_crashed(client, "pool", "line-1", NOW, queue_rules.SETTLED)
    assert text.startswith("run a-run continues from its checkpoint")
    assert client.scheduled == ["run-1"]


def run_of_process(pid: int) -> Any:
    return SimpleNamespace(id="run-1", infrastructure_pid=str(pid))


def processes(folder: Path, state: str, environment: bytes, flags: int = 4194560) -> Path:
    """A folder as ``/proc`` with process 7, whose name holds a bracket and a state."""
    process = folder / "7"
    process.mkdir(parents=True)
    (process / "stat").write_text(f"7 (a) Z) {state} 1 7 7 0 -1 {flags} 0 0")
    (process / "environ").write_bytes(environment)
    return process


def test_a_process_that_is_being_started_is_asked_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dead_runs, "PROCESSES", tmp_path)
    monkeypatch.setattr(dead_runs, "STARTED_WITHIN", timedelta(minutes=1))
    process = processes(tmp_path, "R", b"")
    waits: list[float] = []

    def started(seconds: float) -> None:
        waits.append(seconds)
        (process / "environ").write_bytes(b"HOME=/\0PREFECT__FLOW_RUN_ID=run-1\0")

    monkeypatch.setattr(dead_runs, "sleep", started)
    assert dead_runs.lives(run_of_process(7))
    assert len(waits) == 1


@pytest.mark.parametrize(
    ("state", "environment"),
    [("Z", b""), ("S", b""), ("S", b"PREFECT__FLOW_RUN_ID=run-2\0")],
    ids=["ended", "never-starts", "of-another-run"],
)
def test_a_process_that_does_not_work_on_the_run_does_not_live(
    state: str, environment: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dead_runs, "PROCESSES", tmp_path)
    monkeypatch.setattr(dead_runs, "STARTED_WITHIN", timedelta(seconds=0.02))
    processes(tmp_path, state, environment)
    assert not dead_runs.lives(run_of_process(7))
    assert not dead_runs.lives(run_of_process(8))


def test_a_thread_of_the_kernel_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run without a number looks at every process, among them a hundred such threads."""
    monkeypatch.setattr(dead_runs, "PROCESSES", tmp_path)
    monkeypatch.setattr(dead_runs, "sleep", lambda _seconds: pytest.fail("waited"))
    processes(tmp_path, "S", b"", flags=2129984)
    assert not dead_runs.lives(SimpleNamespace(id="run-1", infrastructure_pid=None))
