"""Checks of the caches of an archive against its files: the list of runs and the index of the ledger."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.archive import Run, derived
from pipelines.archive.listing import agrees, info_of, stamp_of, stored_lines
from pipelines.certificates.entries import FOLDER
from pipelines.certificates.ledger_index import DIGITS, INDEX_FOLDER, all_read, indexed_events, stamps_of
from pipelines.integrity.findings import CHANGED
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from pipelines.archive import Archive
    from pipelines.integrity.findings import VerifiedPart

REMEDY = "remove the file, it is made again automatically"


def check_list(archive: Archive, checked: VerifiedPart) -> None:
    """Lines of the list must agree with the runs, where these were not changed since."""
    place = archive.root / "index" / "list.json"
    lines, state = stored_lines(place)
    if state == derived.EDITED:
        checked.wrong(CHANGED, place, f"was edited since it was made: {REMEDY}")
    for name, (stamp, line) in lines.items():
        run = Run(archive, name)
        if stamp_of(run) != stamp:
            continue
        try:
            info = info_of(run)
        except (ArchiveUnusable, KeyError, TypeError):  # the check of the run reports it
            continue
        if info is None or not agrees(info, line):
            checked.wrong(CHANGED, place, f"disagrees with the files of run {name}: {REMEDY}")


def check_ledger_index(archive: Archive, checked: VerifiedPart) -> None:
    """Events of the index must agree with the files of the ledger, where these were not changed since."""
    stamps = stamps_of(archive.root / FOLDER)
    for digit in DIGITS:
        place = archive.root / INDEX_FOLDER / f"{digit}.noted"
        stored, state = indexed_events(place)
        if state == derived.EDITED:
            checked.wrong(CHANGED, place, f"was edited since it was made: {REMEDY}")
        own = stamps.get(digit, {})
        held = [name for name, one in stored.items() if own.get(name) == one.stamp]
        if any(stored[name].event != event for name, event in all_read(archive.root / FOLDER, held).items()):
            checked.wrong(CHANGED, place, f"disagrees with the files of the ledger: {REMEDY}")
