"""Checks of the ledger: the chain of every unit's events, and the runs that they rest on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.hash_chain import is_number
from pipelines.certificates.entries import SCHEMA, folder_of
from pipelines.integrity.findings import CHANGED, EDITED, MISSING, CheckedPart
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from pipelines.archive.store import Place


def check_shard(shard: Place, checked: CheckedPart) -> CheckedPart:
    """What is wrong with the units of one part of the ledger."""
    known: dict[Place, str] = {}
    for folder in sorted((place for place in shard.iterdir() if place.is_dir()), key=lambda place: place.name):
        before = ""
        names = sorted(place.name for place in folder.iterdir() if place.suffix == ".json" and is_number(place.stem))
        for count, name in enumerate(names, 1):
            place = folder / name
            if name != f"{count:06d}.json":
                checked.wrong(MISSING, folder / f"{count:06d}.json", "is not there, later events of the unit are")
                break
            found = checked.manifest(place, SCHEMA)
            if found is None:
                break
            content, own = found
            if content.get("previous") != before and count > 1:
                checked.wrong(EDITED, folder / names[count - 2], f"is not the event that {name} followed")
            if folder_of(str(content.get("serial"))) != checked.name(folder).replace("\\", "/"):
                checked.wrong(EDITED, place, f"names unit {content.get('serial')!r}, whose folder is another")
            if content.get("sequence") != count:
                checked.wrong(EDITED, place, f"says that it is event {content.get('sequence')!r} of its unit")
            _check_evidence(place, content, known, checked)
            before = own
    return checked


def _check_evidence(place: Place, content: dict[str, Any], known: dict[Place, str], checked: CheckedPart) -> None:
    """Hold what a certificate rests on against the run as it is."""
    if content.get("action") == "revoke":
        return
    run = checked.root / "runs" / Path(str(content.get("run"))).name
    for name, wanted in checked.named(content, "evidence", place).items():
        manifest = run / f"{name}.json"
        found = _hash(manifest, known)
        if not found:
            checked.wrong(MISSING, manifest, f"is not there, certificate {checked.name(place)} rests on it")
        elif found != wanted:
            checked.wrong(EDITED, manifest, f"is not the manifest that certificate {checked.name(place)} rests on")
    table = run / "coefficients.json"
    try:
        there = files.read_json(table).get("sha256") if _hash(table, known) else content.get("coefficients")
    except ArchiveUnusable:  # told where the run is checked
        return
    if there != content.get("coefficients"):
        checked.wrong(CHANGED, table, f"names other coefficients than certificate {checked.name(place)} was given for")


def _hash(place: Place, known: dict[Place, str]) -> str:
    """Hash of a file, computed once; empty where it is not there."""
    if place not in known:
        known[place] = files.sha256(place) if place.is_file() else ""
    return known[place]
