"""The processes of a worker: what it leaves behind ends before it does, what hangs is ended, and a run that lives is not started
a second time."""

import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from each import each
from prefect.client.schemas.objects import StateType
from root_process import ROOT

from pipelines.orchestrator import dead_runs, queue_rules
from pipelines.orchestrator.worker_health import Silence, period_s

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}

# -- the process that a service manager looks at ends after the watchdog, not before it -----------------------------------

ATTEND = (
    "import sys; from pipelines.orchestrator.worker import run_until_orphans_end as run; sys.exit(run(sys.argv[1:]))"
)
WATCHDOG = """
import os, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
parent = os.getppid()
open(sys.argv[1] + "/watches", "w").close()
while os.getppid() == parent:
    time.sleep(0.01)
open(sys.argv[1] + "/acts", "w").close()
while not os.path.exists(sys.argv[1] + "/reached"):
    time.sleep(0.01)
open(sys.argv[1] + "/safe", "w").close()
"""
WORKER = """
import os, subprocess, sys, time
subprocess.Popen([sys.executable, "-c", sys.argv[2], sys.argv[1]], start_new_session=True)
while not os.path.exists(sys.argv[1] + "/watches"):
    time.sleep(0.01)
time.sleep(float(sys.argv[3]))
sys.exit(7)
"""


def until(path: Path) -> None:
    end = time.monotonic() + 60.0
    while not path.exists():
        assert time.monotonic() < end, f"no {path.name}"
        time.sleep(0.01)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_after_the_watchdog_that_its_worker_left(tmp_path: Path, number: signal.Signals) -> None:
    command = [sys.executable, "-c", ATTEND, sys.executable, "-c", WORKER, str(tmp_path), WATCHDOG, "600"]
    with subprocess.Popen(command, cwd=ROOT, env=ENVIRONMENT) as process:
        until(tmp_path / "watches")
        process.send_signal(number)
        until(tmp_path / "acts")
        time.sleep(0.1)
        assert process.poll() is None, "it ended while the watchdog was at work"
        process.send_signal(number)  # whoever is impatient does not end it either
        (tmp_path / "reached").touch()
        assert process.wait(60) == 128 + signal.SIGTERM
    assert (tmp_path / "safe").exists()


def test_it_has_the_status_of_its_worker(tmp_path: Path) -> None:
    (tmp_path / "reached").touch()
    command = [sys.executable, "-c", ATTEND, sys.executable, "-c", WORKER, str(tmp_path), WATCHDOG, "0.1"]
    done = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, timeout=60, check=False)
    assert done.returncode == 7
    assert (tmp_path / "safe").exists()


# -- a worker that hangs is ended by the first process of its service, and only such a one; its run goes on ---------------

BEAT, LONGEST, STARTUP = 30.0, 120.0, 180.0


def said(heartbeats: list[str | None], every: float = BEAT) -> list[bool]:
    """What is said after each question; None: the server did not answer."""
    silence, out = Silence(LONGEST, STARTUP, 3.0 * BEAT), []
    for count, heartbeat in enumerate(heartbeats):
        if heartbeat is None:
            silence.unanswered()
            out.append(False)
        else:
            out.append(silence.heard(heartbeat, 1000.0 + every * count))
    return out


CLOCK_SET_BACK = ["2026-05-01T10:00", "2026-05-01T10:01", "2026-05-01T09:00", "2026-05-01T09:01", "2026-05-01T09:02"]
CASES = {
    "heartbeats that come": ([f"{n}" for n in range(50)], BEAT, False),
    "heartbeats that stop, before the time": (["1", "2", "2", "2", "2"], BEAT, False),
    "heartbeats that stop, after the time": (["1", "2", "2", "2", "2", "2"], BEAT, True),
    "an outage of the server": (["1", "2", *[None] * 20, "2", "2", "2", "2"], BEAT, False),
    "silence after an outage of the server": (["1", "2", *[None] * 20, "2", "2", "2", "2", "2"], BEAT, True),
    "a worker that starts": ([""] * 6, BEAT, False),
    "a worker that starts too slowly": ([""] * 7, BEAT, True),
    "a worker that follows another": (["of its predecessor"] * 6, BEAT, False),
    "a worker that follows another too slowly": (["of its predecessor"] * 7, BEAT, True),
    "a computer that was suspended counts from its waking": (["1", "2", "2", "2", "2", "2", "2"], 3600.0, False),
    "a clock that was set back": (CLOCK_SET_BACK, BEAT, False),
}


@each(CASES)
def test_silence_is_said_after_its_time_and_not_before(name: str) -> None:
    heartbeats, every, silent = CASES[name]
    assert said(heartbeats, every) == [False] * (len(heartbeats) - 1) + [silent]


HANGS = """
import subprocess, sys, time
subprocess.Popen([sys.executable, "-c", "import sys, time; time.sleep(1.0); open(sys.argv[1], 'w').close()", sys.argv[1]])
open(sys.argv[1] + ".begun", "w").close()
time.sleep(600.0)
"""
WATCHED = """
import itertools, os, sys
from pipelines.orchestrator.worker import run_until_orphans_end
from pipelines.orchestrator.worker_health import watched
beats, child = itertools.count(), []
def ask():
    return "the last" if os.path.exists(sys.argv[-1] + ".begun") else str(next(beats))
with watched(ask, lambda: child[0] if child else None, 0.02, 0.1):
    sys.exit(run_until_orphans_end(sys.argv[1:], child.append))
"""


def test_the_worker_is_ended_and_its_run_goes_on(tmp_path: Path) -> None:
    done = tmp_path / "run finished"
    command = [sys.executable, "-c", WATCHED, sys.executable, "-c", HANGS, str(done)]
    ended = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, check=False, timeout=60, capture_output=True, text=True)
    assert ended.returncode == 128 + signal.SIGKILL
    assert done.exists(), "the run that the worker had started was killed with it"
    assert "it hangs and is ended" in ended.stderr + ended.stdout


@each(["", "soon", "0"])
def test_an_unusable_period_is_replaced(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PREFECT_WORKER_HEARTBEAT_SECONDS", text)
    assert period_s() >= 1.0


# -- a run that the server calls crashed is not started a second time beside its own process --------------------------------

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
        assert queue_rules._continue_crashed(client, "pool", "line-1", NOW) == []
        assert client.scheduled == []
    finally:
        process.kill()
        process.wait()
    [text] = queue_rules._continue_crashed(client, "pool", "line-1", NOW)
    assert text.startswith("run a-run continues from its checkpoint")
    assert client.scheduled == ["run-1"]
    state.timestamp = NOW - timedelta(
        seconds=dead_runs.SILENCE_S + 10
    )  # the server may still miss the dead one's heartbeat
    assert queue_rules._continue_crashed(client, "pool", "line-1", NOW) == []


class Queue:
    """A client of the server with two runs of a deployment that were due 20 and 10 minutes ago, on a station that may be busy."""

    def __init__(self, tags: tuple[str, ...], other: tuple[str, ...]) -> None:
        common = {"deployment_id": "d", "tags": tags, "auto_scheduled": True, "run_count": 0}
        self.runs = {
            name: SimpleNamespace(
                id=name, name=name, expected_start_time=NOW - late, state_type=StateType.SCHEDULED, **common
            )
            for name, late in (("first", timedelta(minutes=20)), ("second", timedelta(minutes=10)))
        }
        self.working = [SimpleNamespace(name=name, state_type=StateType.RUNNING) for name in other]

    def of_states(
        self, _client: object, _pool: str, _queue: str, states: tuple[StateType, ...], *_: object
    ) -> list[Any]:
        return [run for run in (*self.runs.values(), *self.working) if run.state_type in states]

    def read_flow_run(self, run: str) -> Any:
        return self.runs[run]

    def set_flow_run_state(self, run: str, state: Any) -> None:
        self.runs[run].state_type = state.type


POLICIES = [  # tags of the runs, what has the station, what is cancelled
    (("latest_start_min=60",), (), ()),
    (("latest_start_min=60",), ("other",), ()),
    (("latest_start_min=5",), (), ("first", "second")),
    (("latest_start_min=15",), (), ("first",)),
    (("latest_start_min=5", "missed=latest"), (), ("first",)),
    (("latest_start_min=60", "busy=skip"), (), ()),
    (("latest_start_min=60", "busy=skip"), ("other",), ("first", "second")),
]


@each(POLICIES, repr)
def test_runs_that_are_missed_or_meet_a_busy_station_are_cancelled_as_their_policy_says(
    row: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    tags, other, cancelled = row
    queue = Queue(tags, other)
    monkeypatch.setattr(queue_rules, "runs_of_queue", queue.of_states)
    monkeypatch.setattr(queue_rules, "get_client", lambda **_: nullcontext(queue))
    told = queue_rules.apply_rules("pool", "line-1", NOW)
    assert [name for name, run in queue.runs.items() if run.state_type == StateType.CANCELLED] == [*cancelled]
    assert [text.split()[1] for text in told] == [*cancelled]


def run_of_process(pid: int) -> Any:
    return SimpleNamespace(id="run-1", infrastructure_pid=str(pid))


def processes(folder: Path, state: str, environment: bytes) -> Path:
    """A folder as ``/proc`` with process 7, whose name holds a bracket and a state."""
    process = folder / "7"
    process.mkdir(parents=True)
    (process / "stat").write_text(f"7 (a) Z) {state} 1 7 7 0 -1 4194560 0 0")
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


@each([("Z", b""), ("S", b""), ("S", b"PREFECT__FLOW_RUN_ID=run-2\0")])  # ended, never starts, of another run
def test_a_process_that_does_not_work_on_the_run_does_not_live(
    row: tuple[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, environment = row
    monkeypatch.setattr(dead_runs, "PROCESSES", tmp_path)
    monkeypatch.setattr(dead_runs, "STARTED_WITHIN", timedelta(seconds=0.02))
    processes(tmp_path, state, environment)
    assert not dead_runs.lives(run_of_process(7))
    assert not dead_runs.lives(run_of_process(8))
    # a run without a number looks at every process, among them a hundred threads of the kernel: none is waited for
    monkeypatch.setattr(dead_runs, "sleep", lambda _seconds: pytest.fail("waited"))
    (tmp_path / "7" / "stat").write_text("7 (a) Z) S 1 7 7 0 -1 2129984 0 0")
    assert not dead_runs.lives(SimpleNamespace(id="run-1", infrastructure_pid=None))
