"""Journal of programming coefficients into devices: for each unit the operations begun and their results.

``programming/<aa>/<hash of the serial>/<sequence>.json``: each file is created once and recorded in the archive's hash chain. The
entry ``begun`` is written before the first write to the device. After a process that was killed it has no result, and the unit is
not certified until it is programmed again.
"""

from collections.abc import Mapping
from typing import Any, Literal

from pipelines.archive import files, hash_chain
from pipelines.archive.provenance import provenance
from pipelines.archive.store import Place
from pipelines.certificates.entries import folder_of, numbered_files
from schemas.errors import ArchiveUnusable, WrongUse

TOP = "programming"
SCHEMA = 1
Event = Literal["begun", "failed", "proved"]


def folder_of_unit(serial: str) -> str:
    """Folder of a unit's journal below the archive's root."""
    return TOP + folder_of(serial).removeprefix("calibrations")


def programming(root: Place, serial: str) -> list[dict[str, Any]]:
    """The journal of a unit, in order; empty for a unit whose memory was never written.

    Raises
    ------
    ArchiveUnusable
        An entry is missing or belongs to another unit.
    """
    folder = root / folder_of_unit(serial)
    paths = numbered_files(folder)
    entries = [files.read_json(path) for path in paths]
    for count, (path, entry) in enumerate(zip(paths, entries, strict=True), 1):
        if path.name != f"{count:06d}.json" or entry.get("serial") != serial:
            raise ArchiveUnusable(
                f"programming: {folder} has entry {path.stem} of unit {entry.get('serial')!r} where entry {count} of {serial!r} "
                "is needed; restore it from a copy"
            )
    return entries


def add(root: Place, serial: str, event: Event, content: Mapping[str, Any]) -> dict[str, Any]:
    """Write the next entry of a unit's journal durably, record it in the hash chain, and return it."""
    by = provenance()
    while True:
        known = programming(root, serial)
        number = len(known) + 1
        stamp = {key: by[key] for key in ("who", "where", "when")}
        entry = {**content, "serial": serial, "sequence": number, "event": event, **stamp, "schema": SCHEMA}
        name = f"{folder_of_unit(serial)}/{number:06d}.json"
        if files.publish_first(root / name, files.manifest_bytes(entry)):
            sealed = {name: files.sha256(root / name)}
            hash_chain.append(root, TOP, sealed, {**by, "run": str(content.get("run", ""))})
            return entry


def unproved(root: Place, serial: str) -> str:
    """The reason why the memory of a unit is not verified; empty if it is, or if it was never written."""
    known = programming(root, serial)
    if not known or known[-1]["event"] == "proved":
        return ""
    last = known[-1]
    if last["event"] == "begun":
        return f"the writing of its memory, begun on {last['when']} by {last['who']} on {last['where']}, has no end"
    return f"the writing of its memory failed on {last['when']}: {last.get('step')}, {last.get('reason')}"


def refuse_unproved(root: Place, serial: str) -> None:
    """Refuse a unit whose memory may contain other coefficients than its own."""
    why = unproved(root, serial)
    if why:
        raise WrongUse(
            f"certify: unit {serial}: {why}; write it again with 'tumbleline station program', which proves what it holds"
        )
