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
from unittest.mock import ANY, Mock

import pytest
from each import each
from prefect.client.schemas.objects import StateType
from root_process import ROOT

from pipelines.orchestrator import dead_runs, queue_rules
from pipelines.orchestrator.worker_health import Silence

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


def attended(folder: Path, seconds: float) -> list[str]:
    """The command of a worker that leaves a watchdog and ends after so long."""
    return [sys.executable, "-c", ATTEND, sys.executable, "-c", WORKER, str(folder), WATCHDOG, str(seconds)]


def test_it_ends_after_the_watchdog_that_its_worker_left_and_has_the_status_of_its_worker(tmp_path: Path) -> None:
    with subprocess.Popen(attended(tmp_path, 600.0), cwd=ROOT, env=ENVIRONMENT) as process:
        until(tmp_path / "watches")
        process.send_signal(signal.SIGTERM)
        until(tmp_path / "acts")
        time.sleep(0.1)
        assert process.poll() is None, "it ended while the watchdog was at work"
        process.send_signal(signal.SIGINT)  # whoever is impatient does not end it either
        (tmp_path / "reached").touch()
        assert process.wait(60) == 128 + signal.SIGTERM
    for name in ("watches", "safe"):
        (tmp_path / name).unlink()
    assert subprocess.run(attended(tmp_path, 0.1), cwd=ROOT, env=ENVIRONMENT, timeout=60, check=False).returncode == 7
    assert (tmp_path / "safe").exists()


# -- a worker that hangs is ended by the first process of its service, and only such a one; its run goes on ---------------

BEAT, LONGEST, STARTUP = 30.0, 120.0, 180.0


CLOCK_SET_BACK = ["2026-05-01T10:00", "2026-05-01T10:01", "2026-05-01T09:00", "2026-05-01T09:01", "2026-05-01T09:02"]
CASES = {
    "heartbeats that come": ([f"{n}" for n in range(50)], BEAT, False),
    "heartbeats that stop": (["1", "2", "2", "2", "2", "2"], BEAT, True),
    "silence after an outage of the server": (["1", "2", *[None] * 20, "2", "2", "2", "2", "2"], BEAT, True),
    "a worker that starts too slowly": ([""] * 7, BEAT, True),
    "a worker that follows another too slowly": (["of its predecessor"] * 7, BEAT, True),
    "a computer that was suspended counts from its waking": (["1", "2", "2", "2", "2", "2", "2"], 3600.0, False),
    "a clock that was set back": (CLOCK_SET_BACK, BEAT, False),
}


@each(CASES)
def test_silence_is_said_after_its_time_and_not_before(name: str) -> None:
    heartbeats, every, silent = CASES[name]
    silence, said = Silence(LONGEST, STARTUP, 3.0 * BEAT), []
    for count, heartbeat in enumerate(heartbeats):  # None: the server did not answer
        if heartbeat is None:
            silence.unanswered()
        said.append(heartbeat is not None and silence.heard(heartbeat, 1000.0 + every * count))
    assert said == [False] * (len(heartbeats) - 1) + [silent]


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


# -- a run that the server calls crashed is not started a second time beside its own process --------------------------------

NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)


@pytest.mark.skipif(sys.platform != "linux", reason="processes are recognised by /proc")
def test_a_crashed_run_whose_process_lives_is_not_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    words = [sys.executable, "-c", "import time; time.sleep(60)"]
    process = subprocess.Popen(words, env={**os.environ, "PREFECT__FLOW_RUN_ID": "run-1"})
    state, tags = SimpleNamespace(timestamp=NOW - timedelta(minutes=2)), ["crashed=continue"]
    run = SimpleNamespace(id="run-1", name="a-run", tags=tags, infrastructure_pid=str(process.pid), state=state)
    monkeypatch.setattr(queue_rules, "runs_of_queue", lambda *_: [run])
    client = Mock()
    client.read_flow_run_states.return_value = [SimpleNamespace(type=StateType.CRASHED)]
    client.read_flow_run.return_value = SimpleNamespace(state_type=StateType.CRASHED)
    try:
        assert queue_rules._continue_crashed(client, "pool", "line-1", NOW) == []
        client.set_flow_run_state.assert_not_called()
    finally:
        process.kill()
        process.wait()
    [text] = queue_rules._continue_crashed(client, "pool", "line-1", NOW)
    assert text.startswith("run a-run continues from its checkpoint")
    client.set_flow_run_state.assert_called_once_with("run-1", ANY, force=True)
    state.timestamp = NOW - timedelta(
        seconds=dead_runs.SILENCE_S + 10
    )  # the server may still miss the dead one's heartbeat
    assert queue_rules._continue_crashed(client, "pool", "line-1", NOW) == []


class Queue:
    """A client of the server with two runs of a deployment that were due 20 and 10 minutes ago, on a station that may be busy."""

    def __init__(self, tags: tuple[str, ...], other: tuple[str, ...]) -> None:
        common = {"deployment_id": "d", "tags": tags, "auto_scheduled": True, "run_count": 0}
        common["state_type"] = StateType.SCHEDULED
        self.runs = {
            name: SimpleNamespace(id=name, name=name, expected_start_time=NOW - timedelta(minutes=late), **common)
            for name, late in (("first", 20), ("second", 10))
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


def lives(pid: int | None) -> bool:
    return dead_runs.lives(SimpleNamespace(id="run-1", infrastructure_pid=None if pid is None else str(pid)))


@pytest.fixture
def process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Process 7 in a folder as ``/proc``, which is being started; its name holds a bracket and a state."""
    monkeypatch.setattr(dead_runs, "PROCESSES", tmp_path)
    monkeypatch.setattr(dead_runs, "STARTED_WITHIN", timedelta(seconds=0.02))
    (tmp_path / "7").mkdir()
    (tmp_path / "7" / "stat").write_text("7 (a) Z) R 1 7 7 0 -1 4194560 0 0")
    (tmp_path / "7" / "environ").write_bytes(b"")
    return tmp_path / "7"


def test_a_process_that_is_being_started_is_asked_again(process: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started = Mock(side_effect=lambda _s: (process / "environ").write_bytes(b"HOME=/\0PREFECT__FLOW_RUN_ID=run-1\0"))
    monkeypatch.setattr(dead_runs, "STARTED_WITHIN", timedelta(minutes=1))
    monkeypatch.setattr(dead_runs, "sleep", started)
    assert lives(7)
    started.assert_called_once()


def test_a_process_that_does_not_work_on_the_run_does_not_live(process: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for state, environment in (
        ("Z", b""),
        ("S", b""),
        ("S", b"PREFECT__FLOW_RUN_ID=run-2\0"),
    ):  # ended, never starts, of another
        (process / "stat").write_text(f"7 (a) Z) {state} 1 7 7 0 -1 4194560 0 0")
        (process / "environ").write_bytes(environment)
        assert not lives(7)
    assert not lives(8)
    # a run without a number looks at every process, among them a hundred threads of the kernel: none is waited for
    monkeypatch.setattr(dead_runs, "sleep", lambda _seconds: pytest.fail("waited"))
    (process / "stat").write_text("7 (a) Z) S 1 7 7 0 -1 2129984 0 0")
    (process / "environ").write_bytes(b"")
    assert not lives(None)
