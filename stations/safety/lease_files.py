"""The parts of a station that are leased, and the notes beside the locks, which state the holder and are written atomically."""

import ipaddress
import json
import os
import platform
import re
import socket
import stat
import time
import uuid
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, get_args

from schemas.host import opened_folder
from schemas.profile import Equipment
from schemas.safety import SAFE_WITHIN_S
from schemas.station import StationConfig
from schemas.station_devices import Device, Slots

Part = Literal["outer", "inner", "chamber", "reader", Equipment]
ROLES: tuple[Equipment, ...] = get_args(Equipment)
PARTS: tuple[Part, ...] = ("outer", "inner", "chamber", "reader")


HERE = "127.0.0.1"
KERNEL_NAMES = Path("/sys/dev/char")


def addresses(config: StationConfig, *, every: bool = False) -> dict[Part, str]:
    """Addresses of the parts of a station, normalised so that equal devices have equal addresses.

    every : include parts that share an address with another; a lease is taken once per address
    """
    by_part: dict[Part, str] = {}
    there: dict[str, Device] = {part: getattr(config.devices, part) for part in PARTS} | config.equipment.there()
    for part in (*PARTS, *ROLES):
        if part in there and (every or address_of(there[part]) not in by_part.values()):
            by_part[part] = address_of(there[part])
    return by_part


def address_of(device: Device | Slots) -> str:
    """IP address, port and device id of a device, or its serial line and device id."""
    if device.serial:
        return f"{_line(device.serial)}/{device.device_id}"
    return f"{_host(device.host)}:{device.port}/{device.device_id}"


def _line(path: str) -> str:
    """The kernel's name of a serial line, which all links and device nodes share."""
    real_path = os.path.realpath(path)
    try:
        node = os.stat(real_path)  # noqa: PTH116 - of a text, as the station's file has it
    except OSError:  # unplugged now; its name does not change
        return real_path
    if not stat.S_ISCHR(node.st_mode):
        return real_path
    known = KERNEL_NAMES / f"{os.major(node.st_rdev)}:{os.minor(node.st_rdev)}"
    return f"/dev/{known.resolve().name}" if known.exists() else real_path


def _host(name: str) -> str:
    """The IP address of a host; all addresses and names of this machine give the loopback address."""
    try:
        addresses = {str(entry[4][0]) for entry in socket.getaddrinfo(name, None, type=socket.SOCK_STREAM)}
    except OSError:  # a name that cannot be resolved now stays the same name
        return name.lower()
    numbers = sorted(
        (ipaddress.ip_address(address.partition("%")[0]) for address in addresses),
        key=lambda number: (number.version, number),
    )
    if any(number.is_loopback or _is_own(str(number)) for number in numbers):
        return HERE
    return str(numbers[0])


def _is_own(number: str) -> bool:
    """Whether an IP address belongs to this machine: only then a socket can bind to it."""
    family = socket.AF_INET6 if ":" in number else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((number, 0))
        except OSError:
            return False
    return True


Role = Literal["run", "watchdog"]


@dataclass(frozen=True)
class Holder:
    """Holder of a lease; ``token`` is shared by all leases of a run.

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
    known = {field.name for field in fields(Holder)}
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
    with opened_folder(path.parent) as handle:
        if handle is not None:
            os.fsync(handle)


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
