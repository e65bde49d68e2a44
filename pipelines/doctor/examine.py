"""All checks in their order, and the document of their results."""

import ctypes
import platform
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pipelines.doctor.archive import archive_checks, key_checks
from pipelines.doctor.check import of_error, unwritable, write_probe
from pipelines.doctor.documents import Check, DoctorDocument
from pipelines.doctor.orchestrator import orchestrator_checks
from pipelines.doctor.software import software_checks
from schemas.errors import TumblelineError
from schemas.shipped import PRODUCT, shipped
from stations.overview import Overview, looked_at
from stations.safety.folder import VARIABLE, state_folder

LEAST_FREE_GB = 1.0  # free space that an archive needs, GB, by default


def examine(archive: str | None = None, station: Path | None = None, free_gb: float = LEAST_FREE_GB) -> DoctorDocument:
    """The state of the installation and of what it is connected to; without a file of a station none is checked."""
    checks = [
        *software_checks(),
        *archive_checks(archive, free_gb),
        *key_checks(archive),
        *orchestrator_checks(),
        *station_checks(station),
        *host_checks(),
    ]
    samples = shipped("deploy")
    faults = sum(c.state == "fault" for c in checks)
    return {
        "ok": not faults,
        "faults": faults,
        "warnings": sum(c.state == "warning" for c in checks),
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": platform.node(),
        "version": metadata.version(PRODUCT),
        "python": platform.python_version(),
        "samples": None if samples is None else str(samples),
        "checks": checks,
    }


STATE, CLOCK = "state folder", "clock"
A_ZONE = "Europe/Berlin"
TIMEX_BYTES = 1024  # struct timex has 208 on 64-bit Linux
TIME_ERROR = 5  # what adjtimex(2) returns while no time server disciplines the clock


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
    """The state of the clock by the kernel, whichever program disciplines it."""
    state = clock_state()
    if state is None:
        return Check(CLOCK, "synchronised", "not configured", "this system does not say", "", "check its time server")
    if state == TIME_ERROR:
        remedy = "start a time service, such as chrony or systemd-timesyncd"
        return Check(CLOCK, "synchronised", "warning", "no", "a clock that a time server disciplines", remedy)
    return Check(CLOCK, "synchronised", "good", "by a time server")


def clock_state() -> int | None:
    """The result of adjtimex(2) that sets nothing; None where the call does not exist or is not allowed."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        state = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
    except (OSError, AttributeError):
        return None
    return state if state >= 0 else None


PART = "station"


def station_checks(path: Path | None) -> list[Check]:
    """The checks of a station's file and, if it is of hardware, of its devices."""
    from schemas.lot import Lot
    from schemas.station import load_station

    if path is None:
        return [Check(PART, "file", "not configured", "no station is named", "", "name its file with --station")]
    try:
        config = load_station(path)
    except TumblelineError as problem:
        return [of_error(PART, "file", problem)]
    out = [Check(PART, "file", "good", f"{config.name} ({config.kind})")]
    if config.kind == "simulated":
        return [*out, Check(PART, "devices", "good", "simulated in the process of each run")]
    try:
        with looked_at(config, Lot.model_construct(units=[])) as look:
            now = look()
    except TumblelineError as problem:
        return [*out, of_error(PART, "devices", problem)]
    return [*out, *_seen(now)]


def _seen(now: Overview) -> list[Check]:
    out = [of_error(PART, part, text, "check its power, cable and address") for part, text in now.faults.items()]
    if not out:
        angles = ", ".join(f"{name} {angle:.3f}°" for name, angle in now.angles_deg.items())
        slots = f"{len(now.slots)} slots with a unit"
        out.append(Check(PART, "devices", "good", f"{angles}, chamber {now.chamber_C:.2f} °C, {slots}"))
    out.append(_lease(now))
    for name, found, good in (("door", now.door, "closed"), ("emergency stop", now.emergency_stop, "released")):
        if found and found != good:
            out.append(Check(PART, name, "warning", found, good, "put it right at the station before the next run"))
    return out


def _lease(now: Overview) -> Check:
    if now.lease is None:
        return Check(PART, "lease", "good", "free")
    holder = now.lease
    found = f"driven by {holder['run']}, process {holder['pid']} on {holder['host']} since {holder['since']}"
    return Check(PART, "lease", "warning", found, "a free lease for the next run", "wait for its end")
