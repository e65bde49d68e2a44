"""A process with a wrong clock reads the wrong time of day, and sleeps and waits as long as ever."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from wrong_clock import WrongClocks

CODE = """
import sys, threading, time
for line in sys.stdin:
    before = time.monotonic()
    time.sleep(0.05)
    threading.Event().wait(0.05)
    print(time.time(), time.monotonic() - before, flush=True)
"""


@pytest.mark.skipif(not WrongClocks.available(), reason="no C compiler, or no GNU C library")
def test_a_clock_is_wrong_at_once_for_a_process_that_runs_and_its_sleeps_are_right(tmp_path: Path) -> None:
    clocks = WrongClocks(tmp_path / "clocks")
    environment = {**os.environ, **clocks.environment("line-1")}
    with subprocess.Popen(
        [sys.executable, "-c", CODE], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for wrong_s in (0, -3600, 3600, 0):
            clocks.set("line-1", wrong_s)
            process.stdin.write("\n")
            process.stdin.flush()
            now, slept = map(float, process.stdout.readline().split())
            assert abs(now - time.time() - wrong_s) < 20.0
            assert 0.09 < slept < 20.0
        assert clocks.holds(process.pid, "line-1") == 1
        process.stdin.close()
