"""A worker that hangs is ended by the first process of its service, and only such a one; its run goes on."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from each import each
from root_process import ROOT

from pipelines.orchestrator.worker_health import Silence

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
ATTEND = """
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
    command = [sys.executable, "-c", ATTEND, sys.executable, "-c", HANGS, str(done)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(command, cwd=ROOT, env=environment, check=False, timeout=60, capture_output=True, text=True)
    assert ended.returncode == 128 + signal.SIGKILL
    assert done.exists(), "the run that the worker had started was killed with it"
    assert "it hangs and is ended" in ended.stderr + ended.stdout


@pytest.mark.parametrize("text", ["", "soon", "0"])
def test_an_unusable_period_is_replaced(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    from pipelines.orchestrator.worker_health import period_s

    monkeypatch.setenv("PREFECT_WORKER_HEARTBEAT_SECONDS", text)
    assert period_s() >= 1.0
