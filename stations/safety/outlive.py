"""Runs a command and ends only when everything that it left behind has ended too: watchdogs that still make a station safe.

For the first process of a container or of a systemd unit: when that ends, the system kills whatever is left. It passes signals
on to the command, takes the orphans in, and ends with the command's status.

    python -m stations.safety.outlive prefect worker start --pool line
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from contextlib import suppress

PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h: orphans become this process' children, as they do under process 1
PASSED_ON = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2)
USAGE = "outlive: no command, one is needed; write it behind: python -m stations.safety.outlive COMMAND …"
SIGNALLED = 128  # as shells tell of a command that a signal ended


def main(command: list[str]) -> int:
    """The command's status, once nothing is left of it."""
    if not command:
        sys.stderr.write(USAGE + "\n")
        return 2
    with suppress(OSError, AttributeError):  # process 1 gets the orphans anyway, and elsewhere there is no such call
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
