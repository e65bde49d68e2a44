"""Leases on the table, chamber and reader of a station: two runs never drive one device, and a dead run's lease becomes free.

A lease is a file lock, which the system releases when its process ends, and a note that names the holder. The note's time of
modification is the heartbeat. Where locks have no effect (a folder shared by machines), the heartbeat alone decides.
"""

import fcntl
import os
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO

from schemas.errors import LeaseLost, OperatorNeeded, StationRefused
from schemas.safety import SAFE_WITHIN_S
from schemas.station import StationConfig
from stations.clock import steady
from stations.safety.folder import log_event
from stations.safety.lease_files import (
    Holder,
    Part,
    addresses,
    lease_file,
    new_holder,
    read_holder,
    seconds_since_beat,
    write_holder,
)

__all__ = ["Holder", "Leases", "holders", "new_holder"]

POLL_S = 0.2
PASSING_S = 5.0  # a lock whose note names no live holder is being taken, released or tested
HANDED_OVER = "the run has ended and left it to its watchdog"
BOTH = "two runs must not command one device"


@dataclass
class Leases:
    """The leases of one holder on the parts of a station; either all or none are held."""

    folder: Path
    holder: Holder
    places: dict[Part, str]
    lapse_s: float
    _locks: dict[Part, TextIO] = field(default_factory=dict["Part", TextIO])
    _beaten: float = 0.0
    _lost: str = ""
    _alone: Any = field(default_factory=threading.RLock)  # heartbeat and gate are two threads

    def take(self) -> None:
        """Takes all leases, or refuses and names the holder of one; waits for a watchdog that is still active."""
        begun = steady()
        try:
            for part in sorted(self.places, key=lambda p: self.places[p]):
                while not self.try_one(part):
                    other = read_holder(self._file(part))
                    if steady() - begun > self._patience(part, other):
                        self.release()
                        self._refuse(part, other)
                    time.sleep(POLL_S)
                self._note(part)
        except OSError as problem:
            self.release()
            raise StationRefused(
                f"station {self.holder.station}: its leases cannot be written in {self._home} ({problem.strerror}), a folder "
                "with room is needed; nothing was moved; make room, or name another in TUMBLELINE_STATE"
            ) from None
        self._beaten = steady()

    def _patience(self, part: Part, other: Holder | None) -> float:
        """Seconds to wait for a lease of another holder: a watchdog, or a lock without a live holder's note."""
        if other is not None and other.role == "watchdog":
            return SAFE_WITHIN_S
        passing = other is None or other.tripped or bool(other.trouble) or not other.lives(self._file(part))
        return PASSING_S if passing else 0.0

    def try_one(self, part: Part) -> bool:
        """Tries to take the lock of one part; returns whether it is held now. An unreadable note does not prevent it."""
        lock = self._locked(part)
        if lock is None:
            return False
        other = read_holder(self._file(part))
        if other is not None and other.token != self.holder.token:
            if other.lives(self._file(part)):
                lock.close()
                return False
            log_event(self.folder, self.holder.station, "lease_taken_over", part=part, of=other.run, pid=other.pid)
        self._locks[part] = lock
        return True

    def note(self, **changes: Any) -> None:
        """Updates the notes of the held leases, as far as they can be written."""
        self.holder = replace(self.holder, **changes)
        for part in self._locks:
            with suppress(OSError):
                self._note(part)

    def hand_over(self) -> None:
        """Releases the locks and leaves the notes, so that the watchdog takes the leases over."""
        with self._alone:
            self._mark(list(self._locks), trouble=HANDED_OVER)
            self._let_go()

    def held(self) -> list[Part]:
        """Parts whose lease is held."""
        return list(self._locks)

    def beat(self) -> None:
        """Renews the heartbeat; a holder that was silent for longer than ``lapse_s`` has lost its leases."""
        with self._alone:
            now = steady()  # taken before the writes, because the process may be stopped in between
            if self._gone():
                return
            for part in list(self._locks):
                self._keep(part)
                with suppress(OSError):
                    os.utime(self._file(part))
            self._beaten = now

    def alive(self) -> None:
        """Raises LeaseLost after a silence in which the watchdog may have taken over the station."""
        if self._gone():
            raise LeaseLost(self._lost)

    def require(self) -> None:
        """Raises LeaseLost if the leases no longer belong to the holder, by its heartbeat or by locks and notes."""
        with self._alone:
            self.alive()
            for part in list(self._locks):
                self._keep(part)
            self.alive()

    def stalled(self) -> list[Part]:
        """Parts whose lock the run's own process still holds: the run is alive and does not respond."""
        others: list[Part] = [part for part in self.places if part not in self._locks]
        names = [read_holder(self._file(part)) for part in others]
        mine = self.holder.token
        return [part for part, name in zip(others, names, strict=True) if name is None or name.token == mine]

    def trip(self) -> None:
        """Marks the leases of a run that does not respond: its station was put into its safe state."""
        self._mark(list(self.places), tripped=True)

    def release(self) -> None:
        """Releases all leases."""
        with self._alone:
            for part in self._locks:
                other = read_holder(self._file(part))
                if other is None or other.token == self.holder.token:
                    with suppress(OSError):
                        self._file(part).unlink(missing_ok=True)
            self._let_go()

    @property
    def _home(self) -> Path:
        return self.folder / "leases"

    def _file(self, part: Part) -> Path:
        return lease_file(self.folder, self.places[part])

    def _note(self, part: Part) -> None:
        write_holder(self._file(part), replace(self.holder, what=part))

    def _mark(self, parts: list[Part], **changes: Any) -> None:
        """Changes the notes of these parts that name this run, as far as they can be written."""
        for part in parts:
            other = read_holder(self._file(part))
            if other is not None and other.token == self.holder.token:
                with suppress(OSError):
                    write_holder(self._file(part), replace(other, **changes))

    def _let_go(self) -> None:
        for lock in self._locks.values():
            lock.close()
        self._locks.clear()

    def _locked(self, part: Part) -> TextIO | None:
        """The lock of a part, taken; None where another process holds it or its file was replaced meanwhile."""
        self._home.mkdir(parents=True, exist_ok=True)
        lock = self._file(part).with_suffix(".lock").open("a+", encoding="utf-8")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            return None
        if self._is_here(part, lock):
            return lock
        lock.close()  # the folder was cleared meanwhile
        return None

    def _is_here(self, part: Part, lock: TextIO) -> bool:
        """Whether this lock is the file under the part's name, which others would lock."""
        try:
            named = self._file(part).with_suffix(".lock").stat()
        except OSError:
            return False
        locked = os.fstat(lock.fileno())
        return (named.st_dev, named.st_ino) == (locked.st_dev, locked.st_ino)

    def _keep(self, part: Part) -> None:
        """Restores a lease whose file was removed, where no other process has taken it since; else the leases are lost."""
        if not self._is_here(part, self._locks[part]):
            try:
                anew = self._locked(part)
            except OSError:  # the folder cannot be created, so no other process can have a lease there either
                return
            if anew is None:
                self._lose(part, read_holder(self._file(part)))
                return
            self._locks[part].close()
            self._locks[part] = anew
        other = read_holder(self._file(part))
        if other is None:
            with suppress(OSError):
                self._note(part)
        elif other.token != self.holder.token:
            self._lose(part, other)
        elif other.tripped and not self.holder.tripped:
            self._lost = self._lost or self._no_response()

    def _lose(self, part: Part, other: Holder | None) -> None:
        who = "another run" if other is None else f"{other.run} (process {other.pid} on {other.host})"
        self._lost = self._lost or (
            f"station {self.holder.station}: the lease on the {_name(part)} at {self.places[part]} now belongs to {who} "
            f"because the leases in {self._home} were removed or replaced during this run; {BOTH}: this run has ended and "
            "sends no further commands; wait for the other run and give the command again: it resumes where it stopped"
        )

    def _gone(self) -> bool:
        if not self._lost and self._locks and steady() - self._beaten > self.lapse_s:
            self._lost = self._no_response()
        return bool(self._lost)

    def _no_response(self) -> str:
        return (
            f"station {self.holder.station}: this run did not respond for more than {self.lapse_s:g} s and has lost its "
            "lease; its watchdog puts the station into its safe state; this run has ended and sends no further commands; "
            "give the command again: it resumes where it stopped"
        )

    def _refuse(self, part: Part, other: Holder | None) -> None:
        which = f"station {self.holder.station}: the {_name(part)} at {self.places[part]}"
        if other is None:
            raise OperatorNeeded(f"{which} is being taken by another run; try again")
        if other.role == "watchdog":
            raise OperatorNeeded(
                f"{which} is held by the watchdog of {other.run} (process "
                f"{other.pid} on {other.host} since {other.since}), which has not made the station safe so far "
                f"({other.trouble or 'no reason is known'}); check the station and correct the cause: "
                "the lease is free as soon as the station is safe"
            )
        age = seconds_since_beat(self._file(part))
        raise OperatorNeeded(
            f"{which} is driven by {other.run} (process {other.pid} on "
            f"{other.host} since {other.since}, last heartbeat {age:.0f} s ago), one run at a time can drive it; wait for its "
            f"end or stop it: its lease is free at the latest {SAFE_WITHIN_S:g} s after its end"
        )


def _name(part: Part) -> str:
    return {"outer": "table", "inner": "table"}.get(part, part)


def holders(folder: Path, config: StationConfig) -> dict[Part, tuple[Holder, float] | None]:
    """Holder of each part of a station and seconds since its last heartbeat; None where a part is free."""
    by_part: dict[Part, tuple[Holder, float] | None] = {}
    for part, address in addresses(config).items():
        path = lease_file(folder, address)
        holder = read_holder(path)
        by_part[part] = (holder, seconds_since_beat(path)) if holder is not None and holder.lives(path) else None
    return by_part
