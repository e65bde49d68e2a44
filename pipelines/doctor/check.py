"""Results, and the checks that several parts share: a file that is written, read and removed; a clock."""

import os
import time
from contextlib import suppress

from pipelines.archive.files import TEMPORARY
from pipelines.archive.store import Place, first_line
from pipelines.doctor.documents import Check

LARGEST_OFFSET_S = 5.0
"""Largest difference of two clocks, s: the order of runs and the days of certificates follow the clock of the host."""

PROBE_BYTES = 2**20  # more than one block or one quota's grain: a full disk refuses it


def judged(part: str, check: str, found: str, needed: str, remedy: str, *, good: bool) -> Check:
    """A good check, or a fault with what is needed and the remedy."""
    return Check(part, check, "good", found) if good else Check(part, check, "fault", found, needed, remedy)


def of_error(part: str, check: str, problem: Exception | str, otherwise: str = "see the message") -> Check:
    """A fault from a message of the form ``where: what was found, what is needed; what to do``, or ``otherwise`` to do."""
    text = str(problem)
    found, _, remedy = text.rpartition("; ")
    return Check(part, check, "fault", found or text, "", remedy if found else otherwise)


def write_probe(folder: Place) -> float:
    """Seconds by which the clock of a folder's file system or object store is ahead of the host's.

    A file of 1 MiB is written, synchronised, read back, and removed in any case.

    Raises OSError: it cannot be written, or other bytes were read than were written.
    """
    probe = folder / f"{TEMPORARY}doctor-{os.getpid()}"
    data = os.urandom(PROBE_BYTES)
    begun = time.time()
    try:
        probe.write_bytes(data)
        ended = time.time()
        if isinstance(probe, os.PathLike):
            _synchronise(probe)
        if probe.read_bytes() != data:
            raise OSError(f"{probe.name}: other bytes were read than were written")
        stamp = probe.stat().st_mtime
    finally:
        with suppress(OSError):
            probe.unlink(missing_ok=True)
    return offset(stamp, begun, ended, 0.05 if isinstance(probe, os.PathLike) else 1.0)


def offset(stamp: float, begun: float, ended: float, resolution_s: float) -> float:
    """Smallest difference, s, of a clock that read ``stamp`` between two readings of the host's; 0 if they may be equal.

    resolution_s : by so much may a stamp be early because its clock has coarse steps
    """
    if stamp > ended:
        return stamp - ended
    return min(stamp + resolution_s - begun, 0.0)


def clock_check(part: str, ahead_s: float, whose: str) -> Check:
    """Whether another clock agrees with that of the host."""
    found = f"{ahead_s:+.1f} s against the host" if ahead_s else "agrees with the host"
    remedy = f"synchronise the clocks of the host and of {whose} with one time server (NTP)"
    needed = f"at most {LARGEST_OFFSET_S:g} s"
    return judged(part, "clock", found, needed, remedy, good=abs(ahead_s) <= LARGEST_OFFSET_S)


def unwritable(part: str, folder: object, problem: OSError, remedy: str) -> Check:
    """A fault of a folder that takes no file."""
    found = f"{folder} cannot be written ({first_line(problem)})"
    return Check(part, "writable", "fault", found, "write permission and free space", remedy)


def _synchronise(path: os.PathLike[str]) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
