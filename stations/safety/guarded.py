"""A station of hardware while a run drives it: leased, its heart beating, a watchdog beside it."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from schemas.errors import StationTimeout
from stations.safety.folder import state_folder, told
from stations.safety.leases import Leases, addresses, new_holder
from stations.safety.watchdog import DONE, READY

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path

    from schemas.station import StationConfig
    from stations.safety.safe_state import Reached

PARTING_S = 10.0  # a run that ends tries so long to leave its station safe; after that its watchdog goes on
START_S = 30.0
LEAVE_S = 10.0


@dataclass
class Protection:
    """What a run has while it drives: the refusal to go on alone, and its word on how it left the station."""

    leases: Leases
    safe: bool = field(init=False, default=False)

    def require(self) -> None:
        """Refuses to go on when the watchdog may have taken the station over."""
        self.leases.require()

    def left(self, reached: Reached) -> None:
        """Takes note of the state in which the run has left the station."""
        self.safe = reached.safe
        holder = self.leases.holder
        told(self.leases.folder, holder.station, "left_safe" if reached.safe else "not_safe", what=reached.sentence())


@contextmanager
def guarded(config: StationConfig, run: str) -> Generator[Protection]:
    """A block in which nobody else drives the station, and after which it is safe, even if this process is killed."""
    folder = state_folder()
    leases = Leases(folder, new_holder(config.name, run), addresses(config), config.safety.lapse_s)
    leases.take()
    stop = threading.Event()
    protection = Protection(leases)
    told(folder, config.name, "driven", run=run, pid=os.getpid())
    try:
        watchdog = _start(config, leases, folder)
    except BaseException:
        leases.release()
        raise
    beat = threading.Thread(target=_beat, args=(leases, stop, config.safety.heartbeat_s), name="heartbeat", daemon=True)
    beat.start()
    try:
        yield protection
    finally:
        stop.set()
        beat.join()
        _dismiss(watchdog, protection)


def _beat(leases: Leases, stop: threading.Event, every_s: float) -> None:
    while not stop.wait(every_s):
        leases.beat()


def _start(config: StationConfig, leases: Leases, folder: Path) -> subprocess.Popen[bytes]:
    """The watchdog, when it has said that it watches; nothing has moved before."""
    with (folder / "watchdog.err").open("ab") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "stations.safety.watchdog"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,  # neither Ctrl-C nor a terminal that closes reaches it
        )
    order = {
        "config": config.model_dump(mode="json"),
        "folder": str(folder),
        "token": leases.holder.token,
        "run": leases.holder.run,
        "wanted": leases.wanted,
    }
    if process.stdin is None or process.stdout is None:
        raise StationTimeout("watchdog: started without its pipes; free some file handles and start again")
    process.stdin.write(json.dumps(order).encode() + b"\n")
    process.stdin.flush()
    ready, _, _ = select.select([process.stdout], [], [], START_S)
    answer = process.stdout.readline() if ready else b""
    process.stdout.close()
    if answer != READY:
        process.kill()
        process.stdin.close()
        process.wait()
        log = folder / "watchdog.err"
        raise StationTimeout(
            f"watchdog: it does not watch after {START_S:g} s, nothing is driven without it; look into {log}"
        )
    return process


def _dismiss(watchdog: subprocess.Popen[bytes], protection: Protection) -> None:
    """Sends the watchdog away where the station is safe; leaves the station to it where it is not."""
    if watchdog.stdin is None:
        return
    if not protection.safe:
        protection.leases.hand_over()
        watchdog.stdin.close()
        _running.append(watchdog)
        return
    try:
        watchdog.stdin.write(DONE)
        watchdog.stdin.close()
        watchdog.wait(LEAVE_S)
    except BrokenPipeError:
        watchdog.wait(LEAVE_S)  # it had taken the station over and is gone
    except subprocess.TimeoutExpired:
        watchdog.kill()
        watchdog.wait()
    protection.leases.release()


_running: list[subprocess.Popen[bytes]] = []  # they end by themselves; kept so that the interpreter does not complain
