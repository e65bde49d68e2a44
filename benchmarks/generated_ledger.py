"""The ledger of a generated archive: every passed calibration is certified for a year or until the next one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from pipelines.archive import Archive, files
from pipelines.certificates.days import months_after
from pipelines.certificates.entries import LedgerEntry
from pipelines.certificates.ledger import Ledger

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
    return Ledger(Archive(folder)).write_bulk(_events(known, hashes))


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
