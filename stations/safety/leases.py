"""Leases: who drives which table and which chamber. Two runs never drive one, and a dead run's lease is free by itself.

A lease is a lock that the system takes back when its process ends, and beside it a note that says who holds it. The note's
time is the heartbeat. Where locks do not reach (a folder shared by machines), the heartbeat alone decides.
"""

from __future__ import annotations

import fcntl
import os
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TextIO

from schemas.errors import LeaseLost, OperatorNeeded, StationRefused
from schemas.safety import SAFE_WITHIN_S
from stations.clock import steady
from stations.safety.addresses import address_of
from stations.safety.folder import told
from stations.safety.lease_files import (
    Holder,
    lease_file,
    new_holder,
    read_holder,
    seconds_since_beat,
    write_holder,
)

if TYPE_CHECKING:
    from pathlib import Path

    from schemas.station import StationConfig

__all__ = ["PARTS", "Holder", "Leases", "Part", "addresses", "holders", "new_holder"]

Part = Literal["outer", "inner", "chamber", "reader"]
PARTS: tuple[Part, ...] = ("outer", "inner", "chamber", "reader")
POLL_S = 0.2
PASSING_S = 5.0  # a lock without a living name is about to be taken or left, or looked at
HANDED_OVER = "the run has ended and left it to its watchdog"
BOTH = "two runs must not command one device"


def addresses(config: StationConfig, *, every: bool = False) -> dict[Part, str]:
    """Where table, chamber and reader of a station are, one name for a place however the file writes it.

    Parameters
    ----------
    every : tell every part, also those that share a place; a lease is taken once for a place
    """
    found: dict[Part, str] = {}
    for part in PARTS:
        address = address_of(getattr(config.devices, part))
        if every or address not in found.values():
            found[part] = address
    return found


@dataclass
class Leases:
    """The leases of one holder on the parts of a station, all or none of them."""

    folder: Path
    holder: Holder
    wanted: dict[Part, str]
    lapse_s: float
    _locks: dict[Part, TextIO] = field(default_factory=dict["Part", TextIO])
    _beaten: float = 0.0
    _lost: str = ""
    _alone: Any = field(default_factory=threading.RLock)  # heartbeat and gate are two threads

    def take(self) -> None:
        """Takes every lease, or refuses with the name of who has one; waits for a watchdog that is still at work."""
        begun = steady()
        try:
            for part in sorted(self.wanted, key=lambda p: self.wanted[p]):
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
        """Seconds to wait for a lease that another has: for a watchdog, and for a lock that nobody's name is on."""
        if other is not None and other.role == "watchdog":
            return SAFE_WITHIN_S
        passing = other is None or other.tripped or bool(other.trouble) or not other.lives(self._file(part))
        return PASSING_S if passing else 0.0

    def try_one(self, part: Part) -> bool:
        """Takes the lock of one part where nobody has it; whether it is held now. A note that cannot be read bars nobody."""
        lock = self._locked(part)
        if lock is None:
            return False
        other = read_holder(self._file(part))
        if other is not None and other.token != self.holder.token:
            if other.lives(self._file(part)):
                lock.close()
                return False
            told(self.folder, self.holder.station, "lease_taken_over", part=part, of=other.run, pid=other.pid)
        self._locks[part] = lock
        return True

    def note(self, **changes: Any) -> None:
        """Writes who holds the leases that are held, as far as it can be written."""
        self.holder = replace(self.holder, **changes)
        for part in self._locks:
            with suppress(OSError):
                self._note(part)

    def hand_over(self) -> None:
        """Lets go of the locks, and leaves the notes for the watchdog, which takes them over."""
        with self._alone:
            self._mark(list(self._locks), trouble=HANDED_OVER)
            self._let_go()

    def held(self) -> list[Part]:
        """Parts whose lease is held."""
        return list(self._locks)

    def beat(self) -> None:
        """Tells that the holder lives, where its leases are still its own; one that was silent for too long has lost them."""
        with self._alone:
            now = steady()  # before anything is written: a process may stand still in between
            if self._gone():
                return
            for part in list(self._locks):
                self._keep(part)
                with suppress(OSError):
                    os.utime(self._file(part))
            self._beaten = now

    def alive(self) -> None:
        """Refuses to go on after a silence in which the watchdog may have taken the station over."""
        if self._gone():
            raise LeaseLost(self._lost)

    def require(self) -> None:
        """Refuses to go on where the leases are not the holder's any more, by its heartbeat or by locks and notes."""
        with self._alone:
            self.alive()
            for part in list(self._locks):
                self._keep(part)
            self.alive()

    def standing(self) -> list[Part]:
        """Parts whose lock another process has, and nobody else's name is on: those of a run that lives and stands still."""
        apart: list[Part] = [part for part in self.wanted if part not in self._locks]
        names = [read_holder(self._file(part)) for part in apart]
        mine = self.holder.token
        return [part for part, name in zip(apart, names, strict=True) if name is None or name.token == mine]

    def trip(self) -> None:
        """Notes on the leases of a holder that stands still that its station was put into its safe state."""
        self._mark(list(self.wanted), tripped=True)

    def release(self) -> None:
        """Gives every lease back."""
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
        return lease_file(self.folder, self.wanted[part])

    def _note(self, part: Part) -> None:
        write_holder(self._file(part), replace(self.holder, what=part))

    def _mark(self, parts: list[Part], **changes: Any) -> None:
        """Changes the notes of these parts that are in this run's name, as far as they can be written."""
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
        """The lock of a part, taken, and the one that its name leads to; None where another has it."""
        self._home.mkdir(parents=True, exist_ok=True)
        lock = self._file(part).with_suffix(".lock").open("a+", encoding="utf-8")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            return None
        if self._is_here(part, lock):
            return lock
        lock.close()  # somebody has cleared the folder in between
        return None

    def _is_here(self, part: Part, lock: TextIO) -> bool:
        """Whether the name of a part's lock leads to this one, and not to one that others would take."""
        try:
            found = self._file(part).with_suffix(".lock").stat()
        except OSError:
            return False
        own = os.fstat(lock.fileno())
        return (found.st_dev, found.st_ino) == (own.st_dev, own.st_ino)

    def _keep(self, part: Part) -> None:
        """Holds a lease that somebody cleared away, where nobody has taken it since; else the leases are lost."""
        if not self._is_here(part, self._locks[part]):
            try:
                anew = self._locked(part)
            except OSError:  # no such folder, and none can be made: nobody else can have a lease there either
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
            self._lost = self._lost or self._stood_still()

    def _lose(self, part: Part, other: Holder | None) -> None:
        who = "another run" if other is None else f"{other.run} (process {other.pid} on {other.host})"
        self._lost = self._lost or (
            f"station {self.holder.station}: the lease on the {_name(part)} at {self.wanted[part]} has gone to {who} because the "
            f"leases in {self._home} were cleared or replaced while this run drove; {BOTH}: this run has ended and sends nothing "
            "more; wait for the other and give the command again: it goes on where it was"
        )

    def _gone(self) -> bool:
        if not self._lost and self._locks and steady() - self._beaten > self.lapse_s:
            self._lost = self._stood_still()
        return bool(self._lost)

    def _stood_still(self) -> str:
        return (
            f"station {self.holder.station}: this run stood still for more than {self.lapse_s:g} s and has lost its lease, its "
            "watchdog puts the station into its safe state; this run has ended and sends nothing more; give the command again: "
            "it goes on where it was"
        )

    def _refuse(self, part: Part, other: Holder | None) -> None:
        which = f"station {self.holder.station}: the {_name(part)} at {self.wanted[part]}"
        if other is None:
            raise OperatorNeeded(f"{which} is being taken by another run; try again")
        if other.role == "watchdog":
            raise OperatorNeeded(
                f"{which} is held by the watchdog of {other.run} (process "
                f"{other.pid} on {other.host} since {other.since}), which could not make the station safe so far "
                f"({other.trouble or 'no reason is noted'}); look at the station and put that right: "
                "it is free as soon as it is safe"
            )
        age = seconds_since_beat(self._file(part))
        raise OperatorNeeded(
            f"{which} is driven by {other.run} (process {other.pid} on "
            f"{other.host} since {other.since}, heard of {age:.0f} s ago), one run at a time can drive it, whatever started "
            f"them; wait for it or stop it: its lease is free at the latest {SAFE_WITHIN_S:g} s after its end"
        )


def _name(part: Part) -> str:
    return {"outer": "table", "inner": "table"}.get(part, part)


def holders(folder: Path, config: StationConfig) -> dict[Part, tuple[Holder, float] | None]:
    """Who drives the parts of a station, and the seconds since each was heard of."""
    found: dict[Part, tuple[Holder, float] | None] = {}
    for part, address in addresses(config).items():
        path = lease_file(folder, address)
        holder = read_holder(path)
        found[part] = (holder, seconds_since_beat(path)) if holder is not None and holder.lives(path) else None
    return found
