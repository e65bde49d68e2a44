"""Runs a command and ends only after all of its orphaned processes have ended: watchdogs that still make a station safe.

Use it as the first process of a container or systemd unit, whose end makes the system kill all remaining processes. It forwards
signals to the command, adopts orphans, and ends with the command's status.

    python -m stations.safety.outlive prefect worker start --pool line
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from contextlib import suppress

PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h: orphans become children of this process
PASSED_ON = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2)
USAGE = "outlive: no command given, one is needed; add it: python -m stations.safety.outlive COMMAND …"
SIGNALLED = 128  # exit status of a command that a signal ended, as in shells


def main(command: list[str]) -> int:
    """Runs a command; its exit status after the last of its processes has ended."""
    if not command:
        sys.stderr.write(USAGE + "\n")
        return 2
    with suppress(OSError, AttributeError):  # process 1 adopts orphans anyway; other systems have no such call
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    running = subprocess.Popen(command)  # noqa: S603 - to run what it is given is what it is for
    for number in PASSED_ON:
        signal.signal(number, lambda which, _frame: _pass_on(running.pid, which))
    status = 0
    while True:
        try:
            pid, how = os.wait()
        except ChildProcessError:
            return status
        if pid == running.pid:
            code = os.waitstatus_to_exitcode(how)
            status = running.returncode = code if code >= 0 else SIGNALLED - code


def _pass_on(pid: int, number: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
