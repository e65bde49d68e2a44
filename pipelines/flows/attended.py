"""A program run as a child, whose orphans are waited for: the watchdog that a killed flow leaves behind ends its work.

A service manager that stops a unit, and a container whose first process ends, kill whatever is left. So the process that they
look at must not end before the watchdog has: it adopts what its descendants leave behind (Linux, ``PR_SET_CHILD_SUBREAPER``).
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import FrameType

PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
STOPS = (signal.SIGTERM, signal.SIGINT)


def attend(command: Sequence[str]) -> int:
    """Exit status of a command, once it and everything that it has left running have ended.

    The command gets a SIGTERM that this process gets; what it has left running does not. A child that a
    signal ended counts as 128 and the signal's number, as shells have it.
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
    child = subprocess.Popen(command, start_new_session=True)  # noqa: S603 - Ctrl-C reaches it once, through this process
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
