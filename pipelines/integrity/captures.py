"""Checks of one capture: every record's files, and the chain from record to record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.capture_journal import FOLDER, Events
from pipelines.archive.hash_chain import is_number
from pipelines.archive.records import COMPLETE
from pipelines.integrity.findings import CHANGED, EDITED, FOREIGN, MISSING, CheckedPart

if TYPE_CHECKING:
    from pipelines.archive.store import Place


def check_capture(path: Place, checked: CheckedPart, schema: int) -> CheckedPart:
    """What is wrong with a capture."""
    records: list[tuple[dict[str, Any], str, Place]] = []
    for folder in sorted(path.iterdir(), key=lambda place: place.name):
        if not is_number(folder.name):
            continue
        found = checked.manifest(folder / "record.json", schema)
        if found is None:
            continue
        content = checked.named(found[0], "content", folder / "record.json")
        for name, wanted in sorted(content.items()):
            checked.table(folder / name, str(wanted))
        if found[0].get("record") != int(folder.name):
            checked.wrong(
                EDITED, folder, f"holds record {found[0].get('record')!r}: two were exchanged, or it was renamed"
            )
        check_strangers(folder, {*content, "record.json"}, checked)
        records.append((*found, folder))
    records.sort(key=lambda one: (str(type(one[0].get("order"))), one[0].get("order", 0)))
    _check_order(records, checked)
    _check_end(path, records, checked, schema)
    if records:
        _check_state(path, records[-1], checked)
    return checked


def check_strangers(folder: Place, known: set[str], checked: CheckedPart) -> None:
    """Tables in a folder that nothing of the archive put there."""
    for place in sorted(folder.iterdir(), key=lambda one: one.name) if folder.is_dir() else ():
        if place.suffix == ".parquet" and place.name not in known and place.is_file():
            checked.wrong(
                FOREIGN, place, "was put there by somebody: take it out; import foreign files with 'tumbleline import'"
            )


def _check_order(records: list[tuple[dict[str, Any], str, Place]], checked: CheckedPart) -> None:
    """Every record names the one before; the first of an archive of an older version names none."""
    before = ""
    for count, (content, found, folder) in enumerate(records):
        if content.get("order") != count:
            checked.wrong(
                MISSING, folder, f"was stored as number {content.get('order')}, and {count} are there before it"
            )
            return
        if content.get("previous", before) != before:
            earlier = records[count - 1][2] if count else folder
            checked.wrong(EDITED, earlier / "record.json", f"is not the manifest that record {folder.name} followed")
        before = found


def _check_end(
    path: Place, records: list[tuple[dict[str, Any], str, Place]], checked: CheckedPart, schema: int
) -> None:
    end = path / COMPLETE
    if not end.is_file():
        checked.remarks.append(f"{checked.name(path)} is not finished: {len(records)} records are stored")
        return
    found = checked.manifest(end, schema)
    if found is None:
        return
    if found[0].get("records") != len(records):
        checked.wrong(MISSING, path, f"holds {len(records)} records, {found[0].get('records')} were stored")
    if "events" in found[0]:  # an older version did not note them
        _check_events(path, checked.named(found[0], "events", end), checked)
    if (
        found[0].get("records") == len(records)
        and records
        and found[0].get("previous", records[-1][1]) != records[-1][1]
    ):
        checked.wrong(EDITED, records[-1][2] / "record.json", "is not the manifest that the capture ended with")


def _check_events(path: Place, wanted: dict[str, str], checked: CheckedPart) -> None:
    """Hold the journal against what the capture's end says of it."""
    found = Events(path).hashes()
    for name in sorted({*wanted, *found}):
        place = path / FOLDER / name
        if name not in found:
            checked.wrong(MISSING, place, "is not there, the capture ended with this event in its journal")
        elif name not in wanted:
            checked.wrong(FOREIGN, place, "was added to the journal after the capture had ended")
        elif found[name] != wanted[name]:
            checked.wrong(CHANGED, place, "is not the event that was in the journal when the capture ended")


def _check_state(path: Place, last: tuple[dict[str, Any], str, Place], checked: CheckedPart) -> None:
    """Hold the station's state, from which the capture goes on, against the record that it was stored with."""
    wanted = last[0].get("state")
    if wanted is None:  # an older version did not note it
        return
    place = path / "state" / f"{last[2].name}.bin"
    if not place.is_file():
        checked.wrong(MISSING, place, f"is not there, record {last[2].name} was stored with this state of the station")
    elif files.sha256(place) != wanted:
        checked.wrong(CHANGED, place, f"is not the state of the station that record {last[2].name} was stored with")
