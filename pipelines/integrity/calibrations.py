"""Checks of the ledger: the chain of events of every unit, and the runs on which certificates are based."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipelines.archive import files
from pipelines.archive.hash_chain import is_number
from pipelines.archive.store import Place
from pipelines.certificates.entries import SCHEMA, folder_of
from pipelines.integrity.findings import CHANGED, EDITED, MISSING, VerifiedPart
from schemas.errors import ArchiveUnusable


def check_shard(shard: Place, checked: VerifiedPart) -> VerifiedPart:
    """Check the units of one part of the ledger."""
    known: dict[Place, str] = {}
    for folder in sorted((place for place in shard.iterdir() if place.is_dir()), key=lambda place: place.name):
        before = ""
        names = sorted(place.name for place in folder.iterdir() if place.suffix == ".json" and is_number(place.stem))
        for count, name in enumerate(names, 1):
            place = folder / name
            if name != f"{count:06d}.json":
                checked.wrong(MISSING, folder / f"{count:06d}.json", "is missing, later events of the unit exist")
                break
            manifest = checked.manifest(place, SCHEMA)
            if manifest is None:
                break
            content, own = manifest
            if content.get("previous") != before and count > 1:
                checked.wrong(EDITED, folder / names[count - 2], f"is not the event that {name} refers to")
            if folder_of(str(content.get("serial"))) != checked.name(folder).replace("\\", "/"):
                checked.wrong(EDITED, place, f"names unit {content.get('serial')!r}, which has another folder")
            if content.get("sequence") != count:
                checked.wrong(EDITED, place, f"says that it is event {content.get('sequence')!r} of its unit")
            _check_evidence(place, content, known, checked)
            before = own
    return checked


def _check_evidence(place: Place, content: dict[str, Any], known: dict[Place, str], checked: VerifiedPart) -> None:
    """Compare the evidence of a certificate with the files of its run."""
    if content.get("action") == "revoke":
        return
    run = checked.root / "runs" / Path(str(content.get("run"))).name
    for name, expected in checked.named(content, "evidence", place).items():
        manifest = run / f"{name}.json"
        actual = _hash(manifest, known)
        if not actual:
            checked.wrong(MISSING, manifest, f"is missing, certificate {checked.name(place)} is based on it")
        elif actual != expected:
            checked.wrong(EDITED, manifest, f"is not the manifest that certificate {checked.name(place)} is based on")
    table = run / "coefficients.json"
    try:
        there = files.read_json(table).get("sha256") if _hash(table, known) else content.get("coefficients")
    except ArchiveUnusable:  # the check of the run reports it
        return
    if there != content.get("coefficients"):
        checked.wrong(CHANGED, table, f"names other coefficients than certificate {checked.name(place)}")


def _hash(place: Place, known: dict[Place, str]) -> str:
    """Hash of a file, computed once; empty where it is not there."""
    if place not in known:
        known[place] = files.sha256(place) if place.is_file() else ""
    return known[place]
