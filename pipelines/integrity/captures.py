"""Checks of one capture: the files of every record, and the chain of the records."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pipelines.archive import files
from pipelines.archive.capture_journal import FOLDER, Events
from pipelines.archive.hash_chain import is_number
from pipelines.archive.records import COMPLETE
from pipelines.archive.store import Place
from pipelines.integrity.findings import CHANGED, EDITED, FOREIGN, MISSING, VerifiedPart


def check_capture(path: Place, checked: VerifiedPart, schema: int) -> VerifiedPart:
    """Check a capture."""
    records: list[tuple[dict[str, Any], str, Place]] = []
    unusable: Place | None = None
    for folder in sorted(path.iterdir(), key=lambda place: place.name):
        if not is_number(folder.name):
            continue
        manifest = checked.manifest(folder / "record.json", schema)
        if manifest is None:
            unusable = unusable or folder / "record.json"
            continue
        content = checked.named(manifest[0], "content", folder / "record.json")
        for name, expected in sorted(content.items()):
            checked.table(folder / name, str(expected))
        if manifest[0].get("record") != int(folder.name):
            checked.wrong(
                EDITED,
                folder,
                f"holds record {manifest[0].get('record')!r}: two folders were exchanged, or this one was renamed",
            )
        check_strangers(folder, {*content, "record.json"}, checked)
        records.append((*manifest, folder))
    records.sort(key=lambda one: (str(type(one[0].get("order"))), one[0].get("order", 0)))
    part = checked.blank()
    _check_order(records, part)
    _check_end(path, records, part, schema)
    if unusable is not None:  # the gap that it leaves in the order
        part.findings = [replace(one, because=checked.name(unusable)) for one in part.findings]
    checked.add(part)
    if records:
        _check_state(path, records[-1], checked)
    return checked


def check_strangers(folder: Place, known: set[str], checked: VerifiedPart) -> None:
    """Tables in a folder that the archive did not write."""
    for place in sorted(folder.iterdir(), key=lambda one: one.name) if folder.is_dir() else ():
        if place.suffix == ".parquet" and place.name not in known and place.is_file():
            checked.wrong(
                FOREIGN,
                place,
                "was not written by the archive: remove it; import foreign files with 'tumbleline import'",
            )


def _check_order(records: list[tuple[dict[str, Any], str, Place]], checked: VerifiedPart) -> None:
    """Every record names the record before it; the first record in an archive of an older version names none."""
    before = ""
    for count, (content, own, folder) in enumerate(records):
        if content.get("order") != count:
            checked.wrong(
                MISSING, folder, f"was stored as number {content.get('order')}, {count} records exist before it"
            )
            return
        if content.get("previous", before) != before:
            earlier = records[count - 1][2] if count else folder
            checked.wrong(EDITED, earlier / "record.json", f"is not the manifest that record {folder.name} refers to")
        before = own


def _check_end(
    path: Place, records: list[tuple[dict[str, Any], str, Place]], checked: VerifiedPart, schema: int
) -> None:
    end = path / COMPLETE
    if not end.is_file():
        checked.remarks.append(f"{checked.name(path)} is not finished: {len(records)} records are stored")
        return
    manifest = checked.manifest(end, schema)
    if manifest is None:
        return
    if manifest[0].get("records") != len(records):
        checked.wrong(MISSING, path, f"holds {len(records)} records, {manifest[0].get('records')} were stored")
    if "events" in manifest[0]:  # older versions did not store them
        _check_events(path, checked.named(manifest[0], "events", end), checked)
    if (
        manifest[0].get("records") == len(records)
        and records
        and manifest[0].get("previous", records[-1][1]) != records[-1][1]
    ):
        checked.wrong(EDITED, records[-1][2] / "record.json", "is not the last manifest of the finished capture")


def _check_events(path: Place, expected: dict[str, str], checked: VerifiedPart) -> None:
    """Compare the journal with its hashes in the last file of the capture."""
    actual = Events(path).hashes()
    for name in sorted({*expected, *actual}):
        place = path / FOLDER / name
        if name not in actual:
            checked.wrong(MISSING, place, "is missing, the finished capture had this event in its journal")
        elif name not in expected:
            checked.wrong(FOREIGN, place, "was added to the journal after the end of the capture")
        elif actual[name] != expected[name]:
            checked.wrong(CHANGED, place, "differs from the event in the journal of the finished capture")


def _check_state(path: Place, last: tuple[dict[str, Any], str, Place], checked: VerifiedPart) -> None:
    """Compare the state of the station, from which the capture continues, with the hash in its record."""
    expected = last[0].get("state")
    if expected is None:  # older versions did not store it
        return
    place = path / "state" / f"{last[2].name}.bin"
    if not place.is_file():
        checked.wrong(MISSING, place, f"is missing, record {last[2].name} refers to this state of the station")
    elif files.sha256(place) != expected:
        checked.wrong(CHANGED, place, f"differs from the state of the station in record {last[2].name}")
