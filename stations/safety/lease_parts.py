"""The parts of a station that are leased, and their addresses."""

import ipaddress
import os
import socket
import stat
from pathlib import Path
from typing import Literal

from schemas.station import StationConfig
from schemas.station_devices import Device, Slots

Part = Literal[
    "outer", "inner", "chamber", "reader", "exciter", "shock_machine", "centrifuge", "power_supply", "step_generator"
]
ROLES: tuple[Part, ...] = ("exciter", "shock_machine", "centrifuge", "power_supply", "step_generator")
PARTS: tuple[Part, ...] = ("outer", "inner", "chamber", "reader")


HERE = "127.0.0.1"
KERNEL_NAMES = Path("/sys/dev/char")


def addresses(config: StationConfig, *, every: bool = False) -> dict[Part, str]:
    """Addresses of table, chamber and reader of a station, in one form however the file writes them.

    Parameters
    ----------
    every : include parts that share an address with another; a lease is taken once per address
    """
    by_part: dict[Part, str] = {}
    for part in PARTS:
        address = address_of(getattr(config.devices, part))
        if every or address not in by_part.values():
            by_part[part] = address
    there = config.equipment.there()
    for role in ROLES:
        if role in there and (every or address_of(there[role]) not in by_part.values()):
            by_part[role] = address_of(there[role])
    return by_part


def address_of(device: Device | Slots) -> str:
    """IP address, port and device id of a device, or its serial line and device id."""
    if device.serial:
        return f"{_line(device.serial)}/{device.device_id}"
    return f"{_host(device.host)}:{device.port}/{device.device_id}"


def _line(path: str) -> str:
    """The kernel's name of a serial line, the same for all links and device nodes."""
    real_path = os.path.realpath(path)
    try:
        node = os.stat(real_path)  # noqa: PTH116 - of a text, as the station's file has it
    except OSError:  # unplugged now; its name stays the same
        return real_path
    if not stat.S_ISCHR(node.st_mode):
        return real_path
    known = KERNEL_NAMES / f"{os.major(node.st_rdev)}:{os.minor(node.st_rdev)}"
    return f"/dev/{known.resolve().name}" if known.exists() else real_path


def _host(name: str) -> str:
    """The IP address of a host; all addresses and names of this machine give one address."""
    try:
        addresses = {str(entry[4][0]) for entry in socket.getaddrinfo(name, None, type=socket.SOCK_STREAM)}
    except OSError:  # a name that cannot be resolved now stays the same name
        return name.lower()
    numbers = sorted(
        (ipaddress.ip_address(one.partition("%")[0]) for one in addresses), key=lambda one: (one.version, one)
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
