"""The notes beside the locks of leases: the holder of each part of a station, written completely or not at all."""

import json
import os
import platform
import re
import time
import uuid
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from schemas.safety import SAFE_WITHIN_S

Role = Literal["run", "watchdog"]


@dataclass(frozen=True)
class Holder:
    """Holder of a lease; ``token`` is the same for all leases of one run.

    ``tripped``: the run did not respond and its watchdog has made the station safe. ``trouble``: what failed so far.
    """

    token: str
    pid: int
    host: str
    run: str
    station: str
    role: Role
    since: str
    what: str = ""
    tripped: bool = False
    trouble: str = ""

    def lives(self, path: Path) -> bool:
        """Whether the holder in ``path`` is alive: a recent heartbeat and, on this machine, a process."""
        if seconds_since_beat(path) > SAFE_WITHIN_S:
            return False
        return self.host != platform.node() or is_process(self.pid)


def new_holder(station: str, run: str, role: Role = "run", token: str = "") -> Holder:
    """A holder of leases that names the present process."""
    since = datetime.now(UTC).isoformat(timespec="seconds")
    return Holder(token or uuid.uuid4().hex, os.getpid(), platform.node(), run, station, role, since)


def lease_file(folder: Path, address: str) -> Path:
    """The file of the note on an address; its lock is beside it."""
    return folder / "leases" / f"{re.sub(r'[^A-Za-z0-9.-]', '_', address)}.json"


def read_holder(path: Path) -> Holder | None:
    """The holder in a lease's note; None where it is missing or unreadable, and the lock decides."""
    known = {one.name for one in fields(Holder)}
    try:
        content = json.loads(path.read_text("utf-8"))
        return Holder(**{name: value for name, value in content.items() if name in known})
    except (OSError, ValueError, TypeError, AttributeError):
        return None


def write_holder(path: Path, holder: Holder) -> None:
    """Replaces a lease's note atomically and flushes it to disk; :class:`OSError` where that fails."""
    aside = path.with_suffix(f".{uuid.uuid4().hex[:8]}")
    try:
        with aside.open("w", encoding="utf-8") as file:
            file.write(json.dumps(asdict(holder)))
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    except OSError:
        aside.unlink(missing_ok=True)
        raise
    handle = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def seconds_since_beat(path: Path) -> float:
    """Seconds since the last heartbeat of a lease's holder; infinite where it has no note."""
    try:
        return max(0.0, time.time() - path.stat().st_mtime)
    except OSError:
        return float("inf")


def is_process(pid: int) -> bool:
    """Whether a process of this host runs."""
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
    return state != "Z"  # killed, and not yet reaped by its parent
