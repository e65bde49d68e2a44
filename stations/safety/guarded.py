"""Protection of a station of hardware during a run: leases, heartbeat and watchdog."""

import os
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field

from schemas.errors import LeaseLost, OperatorNeeded
from schemas.station import StationConfig
from stations.safety.folder import log_event, state_folder
from stations.safety.lease_files import addresses
from stations.safety.leases import Leases, new_holder
from stations.safety.safe_state import Reached
from stations.safety.watchdog_client import Watchdog

SAFE_STATE_S = 10.0  # time in which a run that ends makes its station safe; its watchdog continues afterwards


@dataclass
class Protection:
    """Leases and watchdog of a run; ``safe`` says whether it has left the station safe."""

    leases: Leases
    watchdog: Watchdog
    safe: bool = field(init=False, default=False)

    def require(self) -> None:
        """Refuses to continue without the leases or without a watchdog."""
        self.leases.require()
        if self.watchdog.trouble:
            raise OperatorNeeded(self.watchdog.trouble)

    def leave(self, make_safe: Callable[[float], Reached]) -> None:
        """Puts the station into its safe state; a run that has lost its leases sends no command and logs that."""
        holder = self.leases.holder
        try:
            reached = make_safe(SAFE_STATE_S)
        except LeaseLost as lost:
            log_event(self.leases.folder, holder.station, "lease_lost", run=holder.run, why=str(lost))
            return
        self.safe = reached.safe
        log_event(
            self.leases.folder, holder.station, "left_safe" if reached.safe else "not_safe", what=reached.sentence()
        )


@contextmanager
def guarded(config: StationConfig, run: str) -> Generator[Protection]:
    """A block in which no other run can drive the station, and after which it is made safe, even if this process is killed."""
    folder = state_folder()
    leases = Leases(folder, new_holder(config.name, run), addresses(config), config.safety.lapse_s)
    leases.take()
    stop = threading.Event()
    protection = Protection(leases, Watchdog(config, leases))
    beat = threading.Thread(
        target=_beat, args=(protection, stop, config.safety.heartbeat_s), name="heartbeat", daemon=True
    )
    try:
        protection.watchdog.start()
        beat.start()
        protection.watchdog.require_watching()
    except BaseException:
        stop.set()
        protection.watchdog.dismiss()  # nothing has moved
        leases.release()
        raise
    log_event(folder, config.name, "driven", run=run, pid=os.getpid(), watchdog=protection.watchdog.pid)
    try:
        yield protection
    finally:
        stop.set()
        beat.join()
        if protection.safe:
            protection.watchdog.dismiss()
            leases.release()
        else:
            leases.hand_over()
            protection.watchdog.leave_to_it()


def _beat(protection: Protection, stop: threading.Event, every_s: float) -> None:
    """Sends heartbeats until ``stop`` is set or the leases are lost; without heartbeats the watchdog acts."""
    while not stop.wait(every_s):
        protection.leases.beat()
        try:
            protection.leases.alive()
        except LeaseLost:
            return
        protection.watchdog.beat()
