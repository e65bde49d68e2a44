"""What the leases tell of a station's safety: whether a run that is gone, or stands still, has left it in its safe state."""

from __future__ import annotations

import fcntl
import time
from typing import TYPE_CHECKING

from stations.safety.lease_files import lease_file, read_holder
from stations.safety.leases import addresses

if TYPE_CHECKING:
    from pathlib import Path

    from schemas.station import StationConfig
    from stations.safety.lease_files import Holder


AGAIN_S = 0.5


def not_safe(folder: Path, config: StationConfig) -> str:
    """Why the station does not count as safe, in a sentence; empty where it does, or a run that lives drives it.

    What is found is looked at twice: a lease that is being taken or given back has a lock and no note for a moment.
    """
    if _found(folder, config):
        time.sleep(AGAIN_S)
    return _found(folder, config)


def _found(folder: Path, config: StationConfig) -> str:
    for address in addresses(config).values():
        path = lease_file(folder, address)
        holder, taken = read_holder(path), _is_locked(path.with_suffix(".lock"))
        text = _judged(holder, path, address, taken=taken)
        if text:
            return f"station {config.name}: {text}"
    return ""


def _judged(holder: Holder | None, path: Path, address: str, *, taken: bool) -> str:
    if holder is None:
        if not taken and not path.exists():
            return ""
        state = "is held by a process that cannot be named" if taken else "cannot be read and nobody holds it"
        return f"the lease on {address} {state} ({path}); look at the station before anything is started"
    who = f"{holder.run} (process {holder.pid} on {holder.host} since {holder.since})"
    if holder.lives(path):
        return _of_a_living(holder, who)
    if taken:
        return ""
    return (
        f"{who} has ended and neither it nor its watchdog has told that the station is safe; look at axes and chamber; the next "
        "run or 'station check' takes the lease over and leaves it safe"
    )


def _of_a_living(holder: Holder, who: str) -> str:
    if holder.role == "watchdog":
        return (
            f"the watchdog of {who} is making it safe and has not done so yet ({holder.trouble or 'it has just begun'}); "
            "it goes on until it is safe; look at what it names"
        )
    if holder.tripped:
        return f"{who} stands still; its watchdog has put the station into its safe state; end that process"
    if holder.trouble:
        return f"{who}: {holder.trouble}, which has not told yet that the station is safe; wait a moment and look again"
    return ""


def _is_locked(path: Path) -> bool:
    """Whether a process has a lease's lock; it is only looked at, for a moment."""
    try:
        with path.open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
