"""Whether a station was left in its safe state, judged from its leases."""

import fcntl
import time
from pathlib import Path

from schemas.station import StationConfig
from stations.safety.lease_files import Holder, addresses, lease_file, read_holder

AGAIN_S = 0.5


def unsafe_reason(folder: Path, config: StationConfig) -> str:
    """Why the station does not count as safe; empty where it is safe, or a live run drives it.

    A first finding is checked again: a lease that is being taken or released has a lock and no note for a moment.
    """
    if _reason(folder, config):
        time.sleep(AGAIN_S)
    return _reason(folder, config)


def _reason(folder: Path, config: StationConfig) -> str:
    for address in addresses(config).values():
        path = lease_file(folder, address)
        holder, taken = read_holder(path), _is_locked(path.with_suffix(".lock"))
        text = _reason_of_lease(holder, path, address, taken=taken)
        if text:
            return f"station {config.name}: {text}"
    return ""


def _reason_of_lease(holder: Holder | None, path: Path, address: str, *, taken: bool) -> str:
    if holder is None:
        if not taken and not path.exists():
            return ""
        state = "is held by an unknown process" if taken else "cannot be read and is not held"
        return f"the lease on {address} {state} ({path}); check the station before the next run"
    who = f"{holder.run} (process {holder.pid} on {holder.host} since {holder.since})"
    if holder.lives(path):
        return _reason_of_live_holder(holder, who)
    if taken:
        return ""
    return (
        f"{who} has ended and neither it nor its watchdog has reported the station safe; check axes and chamber; the next "
        "run or 'station check' takes over the lease and leaves the station safe"
    )


def _reason_of_live_holder(holder: Holder, who: str) -> str:
    if holder.role == "watchdog":
        return (
            f"the watchdog of {who} is making the station safe and has not finished ({holder.trouble or 'it has just started'}); "
            "it continues until the station is safe; check the devices that it names"
        )
    if holder.tripped:
        return f"{who} does not respond; its watchdog has put the station into its safe state; end that process"
    if holder.trouble:
        return f"{who}: {holder.trouble}, which has not reported the station safe yet; wait a moment and check again"
    return ""


def _is_locked(path: Path) -> bool:
    """Whether a process holds a lease's lock; the test itself holds it shared for a moment."""
    try:
        with path.open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
