"""What was derived from the archive's files to be quick, held against them: the list of runs, and the ledger's noted events."""

from __future__ import annotations

from dataclasses import astuple
from typing import TYPE_CHECKING

from pipelines.archive import Run, derived
from pipelines.archive.listing import info_of, line_of, noted_lines, stamp_of
from pipelines.certificates.entries import FOLDER
from pipelines.certificates.ledger_index import DIGITS, NOTED, all_read, noted_events, stamps_of
from pipelines.integrity.findings import CHANGED
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from pipelines.archive import Archive
    from pipelines.integrity.findings import CheckedPart

REMEDY = "remove it, it is made again by itself"


def check_list(archive: Archive, checked: CheckedPart) -> None:
    """The noted lines of runs that were not written to since must be those that the runs tell."""
    place = archive.root / "index" / "list.json"
    lines, state = noted_lines(place)
    if state == derived.EDITED:
        checked.wrong(CHANGED, place, f"was edited since it was made: {REMEDY}")
    for name, (stamp, line) in lines.items():
        run = Run(archive, name)
        if stamp_of(run) != stamp:
            continue
        try:
            info = info_of(run)
        except (ArchiveUnusable, KeyError, TypeError):  # told where the run is checked
            continue
        if info is None or astuple(info) != astuple(line_of(line)):
            checked.wrong(CHANGED, place, f"tells otherwise of run {name} than its files: {REMEDY}")


def check_ledger_index(archive: Archive, checked: CheckedPart) -> None:
    """The noted events whose files were not written to since must be those that the files tell."""
    stamps = stamps_of(archive.root / FOLDER)
    for digit in DIGITS:
        place = archive.root / NOTED / f"{digit}.noted"
        noted, state = noted_events(place)
        if state == derived.EDITED:
            checked.wrong(CHANGED, place, f"was edited since it was made: {REMEDY}")
        own = stamps.get(digit, {})
        held = [name for name, one in noted.items() if own.get(name) == one.stamp]
        if any(noted[name].event != event for name, event in all_read(archive.root / FOLDER, held).items()):
            checked.wrong(CHANGED, place, f"tells other events than the ledger's files: {REMEDY}")
