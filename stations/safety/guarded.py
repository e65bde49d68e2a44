"""A station of hardware while a run drives it: leased, its heart beating, a watchdog beside it."""

from __future__ import annotations

import os
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from schemas.errors import LeaseLost, OperatorNeeded
from stations.safety.folder import state_folder, told
from stations.safety.leases import Leases, addresses, new_holder
from stations.safety.watchdog_client import Watchdog

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from schemas.station import StationConfig
    from stations.safety.safe_state import Reached

PARTING_S = 10.0  # a run that ends tries so long to leave its station safe; after that its watchdog goes on


@dataclass
class Protection:
    """What a run has while it drives: its leases, its watchdog, and its word on how it left the station."""

    leases: Leases
    watchdog: Watchdog
    safe: bool = field(init=False, default=False)

    def alive(self) -> None:
        """Refuses a reading where this run has lost its leases by its own silence."""
        self.leases.alive()

    def held(self) -> None:
        """Refuses an order where the leases are not this run's any more."""
        self.leases.require()

    def require(self) -> None:
        """Refuses to go on without the leases, or without a watchdog."""
        self.leases.require()
        if self.watchdog.trouble:
            raise OperatorNeeded(self.watchdog.trouble)

    def leave(self, make_safe: Callable[[float], Reached]) -> None:
        """Leaves the station in its safe state; where the run has lost it, it commands nothing and says so."""
        holder = self.leases.holder
        try:
            reached = make_safe(PARTING_S)
        except LeaseLost as lost:
            told(self.leases.folder, holder.station, "lease_lost", run=holder.run, why=str(lost))
            return
        self.safe = reached.safe
        told(self.leases.folder, holder.station, "left_safe" if reached.safe else "not_safe", what=reached.sentence())


@contextmanager
def guarded(config: StationConfig, run: str) -> Generator[Protection]:
    """A block in which nobody else drives the station, and after which it is safe, even if this process is killed."""
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
    told(folder, config.name, "driven", run=run, pid=os.getpid(), watchdog=protection.watchdog.pid)
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
    """Beats until it is told to stop, or the leases are lost: the watchdog is left alone then, it acts."""
    while not stop.wait(every_s):
        protection.leases.beat()
        try:
            protection.leases.alive()
        except LeaseLost:
            return
        protection.watchdog.beat()
