"""The run's side of its watchdog: starts the process, checks it at each heartbeat, and replaces it if it has ended.

:func:`start_module` and :func:`close_pipes` are also used by the keeper of a bring-up, ``stations/bringup/keeper.py``.
"""

import json
import os
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import IO

from schemas.errors import StationTimeout
from schemas.station import StationConfig
from stations.clock import steady
from stations.safety.folder import log_event
from stations.safety.leases import Leases

# the messages between a run and its watchdog, one line each
READY = b"ready\n"  # the watchdog watches
BEAT = b"here\n"  # sent by the run with each heartbeat, and returned by the watchdog
DONE = b"done\n"  # the run has left the station safe

START_S = 30.0
LEAVE_S = 10.0
STARTS = 3  # consecutive failed starts after which the run ends
CHUNK = 4096
LOG = "watchdog.err"
MODULE = "stations.watchdog"  # started as a process, never imported: it stands above this package


@dataclass
class Watchdog:
    """The watchdog process of this run; ``trouble``: reason why it has none and no further one is started."""

    config: StationConfig
    leases: Leases
    trouble: str = ""
    pid: int = 0
    _process: subprocess.Popen[bytes] | None = None
    _watches: threading.Event = field(default_factory=threading.Event)
    _unanswered: int = 0  # heartbeats since its last answer
    _begun: float = 0.0
    _starts: int = 0  # starts since it was last ready
    _anew: bool = False

    def start(self) -> None:
        """Starts the process and sends it the station; it watches once it is ready."""
        self._starts += 1
        self._begun, self._unanswered = steady(), 0
        self._watches.clear()
        with _errors(self.leases) as errors:
            self._process = start_module(MODULE, errors)
        self.pid = self._process.pid
        order = {
            "config": self.config.model_dump(mode="json"),
            "folder": str(self.leases.folder),
            "token": self.leases.holder.token,
            "run": self.leases.holder.run,
            "wanted": self.leases.places,
        }
        if self._process.stdout is not None:
            os.set_blocking(self._process.stdout.fileno(), False)
        self._send(json.dumps(order).encode() + b"\n")

    def require_watching(self) -> None:
        """Waits until the watchdog is ready; raises StationTimeout if it is not in time."""
        if not self._watches.wait(STARTS * START_S) or self.trouble:
            raise StationTimeout(self.trouble or f"watchdog: not ready after {STARTS * START_S:g} s")

    def beat(self) -> None:
        """Sends the heartbeat and checks the watchdog; a watchdog that has ended or does not answer is replaced."""
        if self.trouble or self._process is None:
            return
        self._listen()
        why = self._gone()
        if not why:
            self._send(BEAT)
            self._unanswered += 1
            return
        self._end()
        log_event(
            self.leases.folder, self.config.name, "watchdog_lost", run=self.leases.holder.run, pid=self.pid, why=why
        )
        if self._starts >= STARTS:
            self.trouble = (
                f"watchdog: {why}, {STARTS} consecutive times, a running one is needed; see {self.leases.folder / LOG}"
            )
            self._watches.set()
            return
        self._anew = True
        self.start()

    def dismiss(self) -> None:
        """Ends the watchdog: the station is safe."""
        if self._process is None:
            return
        self._send(DONE)
        self._close()
        try:
            self._process.wait(LEAVE_S)
        except subprocess.TimeoutExpired:
            self._end()

    def leave_to_it(self) -> None:
        """Leaves the station to the watchdog, which makes it safe and then ends."""
        if self._process is not None:
            self._close()
            _running.append(self._process)

    def _listen(self) -> None:
        """Reads the watchdog's messages since the last call."""
        data = b""
        if self._process is not None and self._process.stdout is not None:
            with suppress(OSError):
                data = os.read(self._process.stdout.fileno(), CHUNK)
        if data:
            self._unanswered = 0
        if READY in data:
            self._starts = 0
            self._watches.set()
            if self._anew:
                log_event(
                    self.leases.folder, self.config.name, "watchdog_anew", run=self.leases.holder.run, pid=self.pid
                )

    def _gone(self) -> str:
        """The reason why the watchdog no longer watches; empty if it watches or is starting."""
        status = None if self._process is None else self._process.poll()
        safety = self.config.safety
        if status is not None:
            return f"it has ended with status {status}"
        if not self._watches.is_set():
            return f"not ready after {START_S:g} s" if steady() - self._begun > START_S else ""
        if self._unanswered > max(3.0, safety.lapse_s / safety.heartbeat_s):
            return f"it has not answered {self._unanswered} heartbeats"
        return ""

    def _send(self, message: bytes) -> None:
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):  # it has ended, which the next heartbeat detects
                self._process.stdin.write(message)
                self._process.stdin.flush()

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._close()
            self._process.wait()
            self._process = None

    def _close(self) -> None:
        if self._process is not None:
            close_pipes(self._process)


def start_module(module: str, errors: IO[bytes] | None = None) -> subprocess.Popen[bytes]:
    """A process that runs a module of the product, with pipes to its input and from its output."""
    return subprocess.Popen(  # noqa: S603 - this interpreter and a module of the product
        [sys.executable, "-m", module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        start_new_session=True,  # neither Ctrl-C, a terminal that closes nor the end of a process group reaches it
    )


def close_pipes(process: subprocess.Popen[bytes]) -> None:
    """Closes the pipes to a process."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


def _errors(leases: Leases) -> IO[bytes]:
    """File for the error output of the watchdog; the null device where no file can be written."""
    try:
        return (leases.folder / LOG).open("ab")
    except OSError:
        return open(os.devnull, "ab")  # noqa: PTH123 - the system's own name


_running: list[subprocess.Popen[bytes]] = []  # they end by themselves; the reference avoids a ResourceWarning
