"""The ledger of a generated archive: every passed calibration is certified for a year or until the next one."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from pipelines.archive import Archive, files
from pipelines.certificates.days import months_after
from pipelines.certificates.entries import LedgerEntry, folder_of

VALID_MONTHS = 12


def write_ledger(folder: Path, calibrations: Iterable[tuple[str, str, str, str, str]]) -> int:
    """Writes the events; their number.

    Parameters
    ----------
    calibrations : serial, device, run, station and day, in order of day for each serial
    """
    known = list(calibrations)
    runs = Archive(folder).root / "runs"
    hashes = {run: files.read_json(runs / run / "coefficients.json")["sha256"] for run in {one[2] for one in known}}
    return write_events(folder, _events(known, hashes))


def write_events(folder: Path, events: Iterable[LedgerEntry]) -> int:
    """Write the events of an archive together, without reading old events or a sync for each file; return their number.

    Parameters
    ----------
    events : of a unit in order, numbered from 1; ``previous`` is filled in.
    """
    count, last = 0, dict[str, str]()
    for event in events:
        data = files.json_bytes(replace(event, previous=last.get(event.serial, "")).document())
        path = Archive(folder).root / folder_of(event.serial) / f"{event.sequence:06d}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        last[event.serial] = hashlib.sha256(data).hexdigest()
        count += 1
    return count


def _events(calibrations: Iterable[tuple[str, str, str, str, str]], hashes: Mapping[str, str]) -> Iterator[LedgerEntry]:
    held: dict[str, tuple[int, str]] = {}
    for serial, device, run, station, day in calibrations:
        sequence, until = held.get(serial, (0, ""))
        ends = (sequence,) if day < until else ()
        held[serial] = (sequence + 1, months_after(day, VALID_MONTHS))
        yield LedgerEntry(
            serial=serial, sequence=sequence + 1, action="supersede" if ends else "certify", device=device, run=run,
            start=day, until=held[serial][1], grade="consumer", station=station, recipe="line",
            coefficients=hashes[run], ends=ends, who="generator", where="generated",
            when=f"{day}T12:00:00.000+00:00", reason="", previous="",
        )  # fmt: skip
