"""Leases: who drives which table and which chamber. Two runs never drive one, and a dead run's lease is free by itself.

A lease is a lock that the system takes back when its process ends, and beside it a file that says who holds it. The file's
time is the heartbeat. Where locks do not reach (a folder shared by machines), the heartbeat alone decides.
"""

from __future__ import annotations

import fcntl
import json
import os
import platform
import re
import time
import uuid
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TextIO

from schemas.errors import OperatorNeeded, StationRefused
from schemas.safety import SAFE_WITHIN_S
from stations.safety.addresses import address_of
from stations.safety.folder import told

if TYPE_CHECKING:
    from schemas.station import StationConfig

Role = Literal["run", "watchdog"]
Part = Literal["outer", "inner", "chamber", "reader"]
PARTS: tuple[Part, ...] = ("outer", "inner", "chamber", "reader")
POLL_S = 0.2


@dataclass(frozen=True)
class Holder:
    """Who holds a lease, since when, and where; ``token`` is the same for all leases of one run."""

    token: str
    pid: int
    host: str
    run: str
    station: str
    role: Role
    since: str
    what: str = ""
    tripped: bool = False


def new_holder(station: str, run: str, role: Role = "run", token: str = "") -> Holder:
    """The holder of leases that this process is."""
    since = datetime.now(UTC).isoformat(timespec="seconds")
    return Holder(token or uuid.uuid4().hex, os.getpid(), platform.node(), run, station, role, since)


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
    _lost: bool = False

    def take(self) -> None:
        """Takes every lease, or refuses with the name of who has one; waits for a watchdog that is still at work."""
        end = time.monotonic() + SAFE_WITHIN_S
        self._home.mkdir(parents=True, exist_ok=True)
        for part in sorted(self.wanted, key=lambda p: self.wanted[p]):
            while not self.try_one(part):
                other = read_holder(self._file(part))
                if other is None or other.role != "watchdog" or time.monotonic() > end:
                    self.release()
                    self._refuse(part, other)
                time.sleep(POLL_S)
        self._beaten = time.monotonic()

    def try_one(self, part: Part) -> bool:
        """Takes the lease of one part where nobody has it; whether it is held now."""
        lock = self._lock_file(part).open("a+", encoding="utf-8")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            return False
        other = read_holder(self._file(part))
        if other is not None and other.token != self.holder.token:
            if _lives(other, self._file(part)):
                lock.close()
                return False
            told(self.folder, self.holder.station, "lease_taken_over", part=part, of=other.run, pid=other.pid)
        self._locks[part] = lock
        self._write(part, replace(self.holder, what=part))
        return True

    def last_beat(self) -> tuple[float, str]:
        """When the first lease's holder was heard of, by the file's clock, and whose it is; 0 and nobody where it is free."""
        path = self._file(next(iter(self.wanted)))
        holder = read_holder(path)
        try:
            return path.stat().st_mtime, holder.token if holder else ""
        except FileNotFoundError:
            return 0.0, ""

    def hand_over(self) -> None:
        """Lets go of the locks, and leaves the leases in the watchdog's name."""
        for lock in self._locks.values():
            lock.close()
        self._locks.clear()

    def held(self) -> list[Part]:
        """Parts whose lease is held."""
        return list(self._locks)

    def beat(self) -> None:
        """Tells that the holder lives; one that has been silent for too long has lost its leases for good."""
        if self._lapsed():
            return
        for part in self._locks:
            try:
                os.utime(self._file(part))
            except FileNotFoundError:  # somebody has cleared the folder away: the lock is still ours
                self._home.mkdir(parents=True, exist_ok=True)
                self._write(part, replace(self.holder, what=part))
        self._beaten = time.monotonic()

    def require(self) -> None:
        """Refuses to go on when the watchdog may have taken the station over."""
        if self._lapsed():
            raise OperatorNeeded(
                f"station {self.holder.station}: this run stood still for more than {self.lapse_s:g} s and its watchdog has "
                "put the station into its safe state; give the command again: it goes on where it was"
            )

    def standing(self) -> list[Part]:
        """Parts whose lock a process still has in the name of this holder's token: it lives and stands still."""
        found: list[Part] = []
        for part in self.wanted:
            other = read_holder(self._file(part))
            if part not in self._locks and other is not None and other.token == self.holder.token:
                found.append(part)
        return found

    def trip(self) -> None:
        """Notes on the leases of a holder that stands still that its station was put into its safe state."""
        for part in self.wanted:
            other = read_holder(self._file(part))
            if other is not None and other.token == self.holder.token:
                self._write(part, replace(other, tripped=True))

    def release(self) -> None:
        """Gives every lease back."""
        for part, lock in self._locks.items():
            other = read_holder(self._file(part))
            if other is not None and other.token == self.holder.token:
                self._file(part).unlink(missing_ok=True)
            lock.close()
        self._locks.clear()

    @property
    def _home(self) -> Path:
        return self.folder / "leases"

    def _file(self, part: Part) -> Path:
        return self._home / f"{_file_name(self.wanted[part])}.json"

    def _lock_file(self, part: Part) -> Path:
        return self._home / f"{_file_name(self.wanted[part])}.lock"

    def _lapsed(self) -> bool:
        self._lost = self._lost or (bool(self._locks) and time.monotonic() - self._beaten > self.lapse_s)
        return self._lost

    def _write(self, part: Part, holder: Holder) -> None:
        path = self._file(part)
        aside = path.with_suffix(f".{uuid.uuid4().hex[:8]}")
        aside.write_text(json.dumps(asdict(holder)), encoding="utf-8")
        aside.replace(path)

    def _refuse(self, part: Part, other: Holder | None) -> None:
        name = {"outer": "table", "inner": "table"}.get(part, part)
        where = self.wanted[part]
        if other is None:
            raise OperatorNeeded(
                f"station {self.holder.station}: the {name} at {where} is being taken by another run; try again"
            )
        age = seconds_since_beat(self._file(part))
        raise OperatorNeeded(
            f"station {self.holder.station}: the {name} at {where} is driven by {other.run} (process {other.pid} on {other.host} "
            f"since {other.since}, heard of {age:.0f} s ago), one run at a time can drive it; wait for it or stop it: its lease "
            f"is free at the latest {SAFE_WITHIN_S:g} s after its end"
        )


def read_holder(path: Path) -> Holder | None:
    """Who a lease's file names; None where there is none."""
    try:
        content = json.loads(path.read_text("utf-8"))
        return Holder(**content)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError):
        raise StationRefused(
            f"leases: {path} cannot be read, a file of this program is needed; look who writes into its folder"
        ) from None


def seconds_since_beat(path: Path) -> float:
    """Seconds since a lease's holder was heard of; infinite where there is no lease."""
    try:
        return max(0.0, time.time() - path.stat().st_mtime)
    except FileNotFoundError:
        return float("inf")


def holders(folder: Path, config: StationConfig) -> dict[Part, tuple[Holder, float] | None]:
    """Who drives the parts of a station, and the seconds since each was heard of."""
    found: dict[Part, tuple[Holder, float] | None] = {}
    for part, address in addresses(config).items():
        path = folder / "leases" / f"{_file_name(address)}.json"
        holder = read_holder(path)
        found[part] = (holder, seconds_since_beat(path)) if holder is not None and _lives(holder, path) else None
    return found


def _lives(other: Holder, path: Path) -> bool:
    """Whether a holder still counts: heard of in time and, on this machine, with a process."""
    if seconds_since_beat(path) > SAFE_WITHIN_S:
        return False
    return other.host != platform.node() or _is_process(other.pid)


def _is_process(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    try:
        state = Path(f"/proc/{pid}/stat").read_text("utf-8", errors="replace").rpartition(")")[2].split()[0]
    except (OSError, IndexError):
        return True
    return state != "Z"  # killed, and its parent has not asked for its status yet


def _file_name(address: str) -> str:
    return re.sub(r"[^A-Za-z0-9.-]", "_", address)
