"""Checks of the ledger, and that everything finished is in the chain of the archive: runs, calibrations and releases.

A run without an entry was copied here, or its entry was removed, or its writer was killed before it wrote the entry. A run whose
writer may still be active gives a remark and no finding.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from pipelines.archive import Run, files, hash_chain
from pipelines.archive.hash_chain import is_number
from pipelines.archive.keys import digest
from pipelines.archive.listing import stages_of
from pipelines.archive.provenance import provenance
from pipelines.archive.signatures import ENTRY
from pipelines.archive.store import Place
from pipelines.certificates.entries import SCHEMA, folder_of
from pipelines.integrity.chain import Chain
from pipelines.integrity.findings import CHANGED, EDITED, MISSING, UNCHAINED, UNREADABLE, VerifiedPart
from schemas.errors import ArchiveUnusable

JUST_NOW = timedelta(minutes=5)  # clocks of hosts may differ by as much: see the ledger
MARK, REPORT = "sealed.json", "report.json"
OF_ANOTHER = "is the seal of another run"
REMEDY = "it was copied here, its entry was removed, or its writer was killed: see 'tumbleline archive clean'"


def check_seals(root: Place, runs: Sequence[Run], chain: Chain, checked: VerifiedPart, *, everything: bool) -> None:
    """Compare finished runs with the chain, and in a check of the whole archive also calibrations and releases."""
    for run in runs:
        _check_run(run, chain, checked)
    if everything:
        for top, pattern in (("calibrations", "*/*/*.json"), ("programming", "*/*/*.json"), ("releases", "*.json")):
            _check_named((root / top).glob(pattern) if (root / top).is_dir() else (), chain, checked)
        for place in sorted((root / "whatif").glob("*.json"), key=str) if (root / "whatif").is_dir() else ():
            _check_evidence(place, checked)


def _check_run(run: Run, chain: Chain, checked: VerifiedPart) -> None:
    mark = run.path / MARK
    if not mark.is_file():
        _check_unsealed(run, chain, checked)
        return
    try:
        content = files.read_json(mark)
    except ArchiveUnusable:
        checked.wrong(EDITED, mark, "is not a readable seal; restore it from a copy")
        return
    number = content.get("entry")
    if not isinstance(number, int) or number < 1:
        checked.wrong(EDITED, mark, f"names entry {number!r} of the chain, a number is needed; restore it from a copy")
    elif number not in chain.entries:
        entry = hash_chain.place_of_entry(run.archive.root, number)
        checked.wrong(MISSING, entry, f"is missing, it sealed run {run.id}")
    elif f"runs/{run.id}/run.json" not in checked.named(content, "files", mark):
        checked.wrong(
            EDITED, mark, f"{OF_ANOTHER}: the folder was exchanged with another or renamed; restore it from a copy"
        )
    elif chain.entries[number] != content["files"]:
        checked.wrong(
            EDITED,
            mark,
            f"differs from what entry {number} of the chain sealed: run and chain are not from one archive",
        )
    elif not set(content) <= {"entry", "files", "stages"} or files.json_bytes(content) != mark.read_bytes():
        checked.wrong(EDITED, mark, "was changed since it was written; restore it from a copy")
    else:
        _check_stages(run, content, checked)


def _check_stages(run: Run, content: dict[str, Any], checked: VerifiedPart) -> None:
    """The stages in a seal, which lists show, must be the stages that made the tables."""
    named = {name.rpartition("/")[2] for name in content["files"] if name.startswith("runs/")}
    there = {place.name for place in run.path.glob("*.json") if place.name != MARK}
    try:
        if named == there and "stages" in content and content["stages"] != stages_of(run.path):
            checked.wrong(EDITED, run.path / MARK, "names other stages than those that made the tables")
    except ArchiveUnusable:  # the check of the run reports it
        return


def _check_unsealed(run: Run, chain: Chain, checked: VerifiedPart) -> None:
    """A run without a seal: unfinished, made by a version without a chain, or a finding."""
    own = f"runs/{run.id}/"
    if any(name.startswith(own) for name in chain.sealed):
        checked.wrong(MISSING, run.path / MARK, "is missing, the chain of the archive has an entry for the run")
        return
    if not (run.path / REPORT).is_file():
        return
    try:
        content = files.read_json(run.path / REPORT)
    except ArchiveUnusable:  # the check of the run reports it
        return
    if "manifests" in content:  # versions without a chain did not write this
        _report(run.path / REPORT, content, checked)


def _check_named(places: Iterable[Place], chain: Chain, checked: VerifiedPart) -> None:
    for place in sorted(places, key=str):
        if is_number(place.stem) and checked.name(place).replace("\\", "/") not in chain.sealed:
            try:
                _report(place, files.read_json(place), checked)
            except ArchiveUnusable:  # the check of the ledger reports it
                continue


def _check_evidence(place: Place, checked: VerifiedPart) -> None:
    """The evidence of a release has the hash of its content in its name; provenance is not part of it."""
    try:
        content = files.read_json(place)
    except ArchiveUnusable:
        checked.wrong(UNREADABLE, place, "is not a readable manifest")
        return
    kept = {name: value for name, value in content.items() if name not in {*provenance(), ENTRY}}
    if place.stem != f"{str(kept.get('model'))[:10]}-{digest(kept)[:10]}":
        checked.wrong(EDITED, place, "was edited: its name does not agree with its content")


def _report(place: Place, content: dict[str, Any], checked: VerifiedPart) -> None:
    if _is_recent(str(content.get("when", ""))):
        checked.remarks.append(
            f"{checked.name(place)} is not in the chain yet: its writer is still active, or was killed a moment ago"
        )
    else:
        checked.wrong(UNCHAINED, place, f"is in no entry of the archive's chain: {REMEDY}")


def _is_recent(when: str) -> bool:
    try:
        age = datetime.now(UTC) - datetime.fromisoformat(when)
    except (ValueError, TypeError):
        return False
    return -JUST_NOW < age < JUST_NOW


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
            _check_certified(place, content, known, checked)
            before = own
    return checked


def _check_certified(place: Place, content: dict[str, Any], known: dict[Place, str], checked: VerifiedPart) -> None:
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
