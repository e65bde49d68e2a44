"""The run's side of its watchdog: started before anything moves, looked at with each heartbeat, started anew where it is gone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING

from schemas.errors import StationTimeout
from stations.clock import steady
from stations.safety.folder import told
from stations.safety.watchdog_protocol import BEAT, DONE, READY

if TYPE_CHECKING:
    from schemas.station import StationConfig
    from stations.safety.leases import Leases

START_S = 30.0
LEAVE_S = 10.0
STARTS = 3  # that fail one after another before the run gives up
CHUNK = 4096
LOG = "watchdog.err"


@dataclass
class Watchdog:
    """The process that watches this run; ``trouble`` says why there is none and will be none."""

    config: StationConfig
    leases: Leases
    trouble: str = ""
    pid: int = 0
    _process: subprocess.Popen[bytes] | None = None
    _watches: threading.Event = field(default_factory=threading.Event)
    _unanswered: int = 0  # heartbeats since it was heard of
    _begun: float = 0.0
    _starts: int = 0  # since it last watched
    _anew: bool = False

    def start(self) -> None:
        """Starts the process; it watches when it says so."""
        self._starts += 1
        self._begun, self._unanswered = steady(), 0
        self._watches.clear()
        with _errors(self.leases) as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "stations.watchdog"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                start_new_session=True,  # neither Ctrl-C, a terminal that closes nor the end of a process group reaches it
            )
        self.pid = self._process.pid
        order = {
            "config": self.config.model_dump(mode="json"),
            "folder": str(self.leases.folder),
            "token": self.leases.holder.token,
            "run": self.leases.holder.run,
            "wanted": self.leases.wanted,
        }
        if self._process.stdout is not None:
            os.set_blocking(self._process.stdout.fileno(), False)
        self._say(json.dumps(order).encode() + b"\n")

    def require_watching(self) -> None:
        """Comes back when it watches; refuses where it does not."""
        if not self._watches.wait(STARTS * START_S) or self.trouble:
            raise StationTimeout(self.trouble or f"watchdog: it does not watch after {STARTS * START_S:g} s")

    def beat(self) -> None:
        """Tells it that the run lives, and looks whether it does itself; one that is gone or stands still is replaced."""
        if self.trouble or self._process is None:
            return
        self._listen()
        why = self._gone()
        if not why:
            self._say(BEAT)
            self._unanswered += 1
            return
        self._end()
        told(self.leases.folder, self.config.name, "watchdog_lost", run=self.leases.holder.run, pid=self.pid, why=why)
        if self._starts >= STARTS:
            self.trouble = (
                f"watchdog: {why}, {STARTS} times one after another, a station is not driven without one; look into "
                f"{self.leases.folder / LOG}"
            )
            self._watches.set()
            return
        self._anew = True
        self.start()

    def dismiss(self) -> None:
        """Sends it away: the station is safe."""
        if self._process is None:
            return
        self._say(DONE)
        self._close()
        try:
            self._process.wait(LEAVE_S)
        except subprocess.TimeoutExpired:
            self._end()

    def leave_to_it(self) -> None:
        """Leaves the station to it: it makes it safe, and ends by itself."""
        if self._process is not None:
            self._close()
            _running.append(self._process)

    def _listen(self) -> None:
        """Takes what it has said since the last time."""
        found = b""
        if self._process is not None and self._process.stdout is not None:
            with suppress(OSError):
                found = os.read(self._process.stdout.fileno(), CHUNK)
        if found:
            self._unanswered = 0
        if READY in found:
            self._starts = 0
            self._watches.set()
            if self._anew:
                told(self.leases.folder, self.config.name, "watchdog_anew", run=self.leases.holder.run, pid=self.pid)

    def _gone(self) -> str:
        """Why it does not watch any more; empty where it does, or is about to."""
        status = None if self._process is None else self._process.poll()
        safety = self.config.safety
        if status is not None:
            return f"it has ended with status {status}"
        if not self._watches.is_set():
            return f"it does not watch after {START_S:g} s" if steady() - self._begun > START_S else ""
        if self._unanswered > max(3.0, safety.lapse_s / safety.heartbeat_s):
            return f"it has not answered {self._unanswered} heartbeats"
        return ""

    def _say(self, words: bytes) -> None:
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):  # it is gone, which the next heartbeat finds
                self._process.stdin.write(words)
                self._process.stdin.flush()

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._close()
            self._process.wait()
            self._process = None

    def _close(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout) if self._process is not None else ():
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()


def _errors(leases: Leases) -> IO[bytes]:
    """Where a watchdog that fails says why; nowhere where nothing can be written."""
    try:
        return (leases.folder / LOG).open("ab")
    except OSError:
        return open(os.devnull, "ab")  # noqa: PTH123 - the system's own name


_running: list[subprocess.Popen[bytes]] = []  # they end by themselves; kept so that the interpreter does not complain
