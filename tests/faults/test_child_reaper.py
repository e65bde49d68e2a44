"""A worker that is told to end: the process that a service manager looks at ends after the watchdog, not before it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from root_process import ROOT

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
import subprocess, sys, time
subprocess.Popen([sys.executable, "-c", sys.argv[2], sys.argv[1]], start_new_session=True)
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
    with subprocess.Popen(command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}) as process:
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
    done = subprocess.run(command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, timeout=60, check=False)
    assert done.returncode == 7
    assert (tmp_path / "safe").exists()
