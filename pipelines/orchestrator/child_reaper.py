"""Run a program as a child and wait for its orphans, so that the watchdog of a killed flow can finish its work.

A service manager that stops a unit, and a container whose first process ends, kill the remaining processes. The main process
must therefore end after the watchdog: it adopts the orphans of its descendants (Linux, ``PR_SET_CHILD_SUBREAPER``).
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
from collections.abc import Callable, Sequence
from types import FrameType

PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
STOPS = (signal.SIGTERM, signal.SIGINT)


def run_until_orphans_end(
    command: Sequence[str], begun: Callable[[subprocess.Popen[bytes]], None] = lambda _child: None
) -> int:
    """Run a command, wait for it and its orphans, and return its exit status.

    Parameters
    ----------
    begun : called with the child; only this function waits for it.

    Notes
    -----
    A SIGTERM to this process is passed to the command, not to its orphans. The exit status of a child that a
    signal ended is 128 plus the signal's number, as in shells.
    """
    _adopt_orphans()
    stopped = False

    def pass_on(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True
        if child is not None and child.returncode is None:
            os.kill(child.pid, signal.SIGTERM)

    child: subprocess.Popen[bytes] | None = None
    for number in STOPS:
        signal.signal(number, pass_on)
    child = subprocess.Popen(command, start_new_session=True)  # noqa: S603 - this process passes Ctrl-C on once
    begun(child)
    if stopped:
        child.terminate()
    status = 0
    while True:
        try:
            pid, how = os.wait()
        except ChildProcessError:
            return status
        if pid == child.pid:
            child.returncode = code = os.waitstatus_to_exitcode(how)
            status = code if code >= 0 else 128 - code


def _adopt_orphans() -> None:
    library = ctypes.CDLL(None, use_errno=True)
    if library.prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_CHILD_SUBREAPER)")
