"""One name for the place of a device, by whatever name its station's file calls it: two names of one device are one lease."""

from __future__ import annotations

import ipaddress
import os
import socket
import stat
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from schemas.station import Device, Slots

HERE = "127.0.0.1"
KERNEL_NAMES = Path("/sys/dev/char")


def address_of(device: Device | Slots) -> str:
    """The host's number, port and device id of a device, or its serial line and device id."""
    if device.serial:
        return f"{_line(device.serial)}/{device.device_id}"
    return f"{_host(device.host)}:{device.port}/{device.device_id}"


def _line(path: str) -> str:
    """The kernel's name of a serial line: links and further nodes for it lead to the same."""
    found = os.path.realpath(path)
    try:
        node = os.stat(found)  # noqa: PTH116 - of a text, as the station's file has it
    except OSError:  # pulled out now; its name is still the same
        return found
    if not stat.S_ISCHR(node.st_mode):
        return found
    known = KERNEL_NAMES / f"{os.major(node.st_rdev)}:{os.minor(node.st_rdev)}"
    return f"/dev/{known.resolve().name}" if known.exists() else found


def _host(name: str) -> str:
    """The number of a host; this machine under any of its numbers and names is one place."""
    try:
        found = {str(entry[4][0]) for entry in socket.getaddrinfo(name, None, type=socket.SOCK_STREAM)}
    except OSError:  # a name that nobody knows now is still the same name
        return name.lower()
    numbers = sorted((ipaddress.ip_address(one.partition("%")[0]) for one in found), key=lambda one: (one.version, one))
    if any(number.is_loopback or _is_own(str(number)) for number in numbers):
        return HERE
    return str(numbers[0])


def _is_own(number: str) -> bool:
    """Whether this machine has a number: only then can it be bound to."""
    family = socket.AF_INET6 if ":" in number else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((number, 0))
        except OSError:
            return False
    return True
