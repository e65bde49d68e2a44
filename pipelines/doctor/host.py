"""The host: the folder of leases and logs is writable, time zones are known, and its clock is synchronised."""

from __future__ import annotations

import ctypes
import sys
from datetime import datetime
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pipelines.doctor.check import Check, of_error, unwritable, write_probe
from schemas.errors import TumblelineError
from stations.safety.folder import VARIABLE, state_folder

STATE, CLOCK = "state folder", "clock"
A_ZONE = "Europe/Berlin"
TIMEX_BYTES = 1024  # struct timex has 208 on 64-bit Linux
TIME_ERROR = 5
"""What adjtimex(2) returns while no time server disciplines the clock."""


def host_checks() -> list[Check]:
    """The checks of the state folder and of the clock."""
    return [_state_folder(), _zone(), _synchronised()]


def _state_folder() -> Check:
    try:
        folder = state_folder()
    except TumblelineError as problem:
        return of_error(STATE, "writable", problem)
    try:
        write_probe(folder)
    except OSError as problem:
        return unwritable(STATE, folder, problem, f"make room, or name another folder in {VARIABLE}")
    return Check(STATE, "writable", "good", str(folder))


def _zone() -> Check:
    now = datetime.now().astimezone()
    found = f"{now.tzname()}, UTC{now:%z}"
    try:
        ZoneInfo(A_ZONE)
    except ZoneInfoNotFoundError:
        remedy = "install the package tzdata of the system or of Python: schedules name time zones"
        return Check(CLOCK, "time zone", "fault", f"{found}; zones by name are not known", "zones by name", remedy)
    return Check(CLOCK, "time zone", "good", found)


def _synchronised() -> Check:
    """What the kernel says of its clock, whichever program disciplines it."""
    state = clock_state()
    if state is None:
        return Check(CLOCK, "synchronised", "not configured", "this system does not say", "", "check its time server")
    if state == TIME_ERROR:
        remedy = "start a time service, such as chrony or systemd-timesyncd"
        return Check(CLOCK, "synchronised", "warning", "no", "a clock that a time server disciplines", remedy)
    return Check(CLOCK, "synchronised", "good", "by a time server")


def clock_state() -> int | None:
    """What adjtimex(2) returns when nothing is set; None where there is no such call or it is not allowed."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        state = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
    except (OSError, AttributeError):
        return None
    return state if state >= 0 else None
