"""Checks of one capture: every record's files, and the chain from record to record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.archive.records import COMPLETE
from pipelines.trace.checks.findings import EDITED, FOREIGN, MISSING, Checked

if TYPE_CHECKING:
    from pipelines.archive.store import Place


def check_capture(path: Place, checked: Checked, schema: int) -> Checked:
    """What is wrong with a capture."""
    records: list[tuple[dict[str, Any], str, Place]] = []
    for folder in sorted(path.iterdir(), key=lambda place: place.name):
        if not folder.name.isdigit():
            continue
        found = checked.manifest(folder / "record.json", schema)
        if found is None:
            continue
        content = found[0].get("content", {})
        for name, wanted in sorted(content.items()):
            checked.table(folder / name, str(wanted))
        check_strangers(folder, {*content, "record.json"}, checked)
        records.append((*found, folder))
    records.sort(key=lambda one: one[0].get("order", 0))
    _check_order(records, checked)
    _check_end(path, records, checked, schema)
    return checked


def check_strangers(folder: Place, known: set[str], checked: Checked) -> None:
    """Tables in a folder that nothing of the archive put there."""
    for place in sorted(folder.iterdir(), key=lambda one: one.name) if folder.is_dir() else ():
        if place.suffix == ".parquet" and place.name not in known and place.is_file():
            checked.wrong(
                FOREIGN, place, "was put there by somebody: take it out; import foreign files with 'tumbleline import'"
            )


def _check_order(records: list[tuple[dict[str, Any], str, Place]], checked: Checked) -> None:
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


def _check_end(path: Place, records: list[tuple[dict[str, Any], str, Place]], checked: Checked, schema: int) -> None:
    end = path / COMPLETE
    if not end.is_file():
        checked.remarks.append(f"{checked.name(path)} is not finished: {len(records)} records are stored")
        return
    found = checked.manifest(end, schema)
    if found is None:
        return
    if found[0].get("records") != len(records):
        checked.wrong(MISSING, path, f"holds {len(records)} records, {found[0].get('records')} were stored")
    elif records and found[0].get("previous", records[-1][1]) != records[-1][1]:
        checked.wrong(EDITED, records[-1][2] / "record.json", "is not the manifest that the capture ended with")
