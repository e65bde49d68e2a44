"""Checks that everything finished is in the archive's chain: runs, calibrations and releases, each as its entry names it.

What no entry names was copied here, or its entry was taken away, or its writer was killed in between; of a writer that is at work
just now it is said and not held against the archive.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from pipelines.archive import files, hash_chain
from pipelines.archive.hash_chain import is_number
from pipelines.archive.keys import digest
from pipelines.archive.listing import stages_of
from pipelines.archive.provenance import provenance
from pipelines.archive.signatures import ENTRY
from pipelines.integrity.findings import EDITED, MISSING, UNCHAINED, UNREADABLE, CheckedPart
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pipelines.archive import Run
    from pipelines.archive.store import Place
    from pipelines.integrity.chain import Chain

JUST_NOW = timedelta(minutes=5)  # as long as clocks of hosts may differ: see the ledger
MARK, REPORT = "sealed.json", "report.json"
REMEDY = "it was copied here, its entry was taken away, or its writer was killed: see 'tumbleline archive clean'"


def check_seals(root: Place, runs: Sequence[Run], told: Chain, checked: CheckedPart, *, everything: bool) -> None:
    """Hold finished runs, and where everything is looked at also calibrations and releases, against what the chain names."""
    for run in runs:
        _check_run(run, told, checked)
    if everything:
        for top, pattern in (("calibrations", "*/*/*.json"), ("releases", "*.json")):
            _check_named((root / top).glob(pattern) if (root / top).is_dir() else (), told, checked)
        for place in sorted((root / "whatif").glob("*.json"), key=str) if (root / "whatif").is_dir() else ():
            _check_evidence(place, checked)


def _check_run(run: Run, told: Chain, checked: CheckedPart) -> None:
    mark = run.path / MARK
    if not mark.is_file():
        _check_unsealed(run, told, checked)
        return
    try:
        content = files.read_json(mark)
    except ArchiveUnusable:
        checked.wrong(EDITED, mark, "is no mark that can be read; restore it from a copy")
        return
    number = content.get("entry")
    if not isinstance(number, int) or number < 1:
        checked.wrong(EDITED, mark, f"names entry {number!r} of the chain, a number is needed; restore it from a copy")
    elif number not in told.entries:
        entry = hash_chain.place_of_entry(run.archive.root, number)
        checked.wrong(MISSING, entry, f"is not there, it sealed run {run.id}")
    elif told.entries[number] != content.get("files") or f"runs/{run.id}/run.json" not in content["files"]:
        checked.wrong(
            EDITED, mark, f"is not what entry {number} of the chain sealed: run and chain are not of one archive"
        )
    elif not set(content) <= {"entry", "files", "stages"} or files.json_bytes(content) != mark.read_bytes():
        checked.wrong(EDITED, mark, "is not as it was written; restore it from a copy")
    else:
        _check_stages(run, content, checked)


def _check_stages(run: Run, content: dict[str, Any], checked: CheckedPart) -> None:
    """The stages that a mark tells, for lists, must be those that made the tables."""
    named = {name.rpartition("/")[2] for name in content["files"] if name.startswith("runs/")}
    there = {place.name for place in run.path.glob("*.json") if place.name != MARK}
    try:
        if named == there and "stages" in content and content["stages"] != stages_of(run.path):
            checked.wrong(EDITED, run.path / MARK, "tells other stages than those that made the tables")
    except ArchiveUnusable:  # told where the run is checked
        return


def _check_unsealed(run: Run, told: Chain, checked: CheckedPart) -> None:
    """A run without the mark that it was sealed: not finished, made before there was a chain, or else not as it should be."""
    own = f"runs/{run.id}/"
    if any(name.startswith(own) for name in told.sealed):
        checked.wrong(MISSING, run.path / MARK, "is not there, the archive's chain has an entry for the run")
        return
    if not (run.path / REPORT).is_file():
        return
    try:
        content = files.read_json(run.path / REPORT)
    except ArchiveUnusable:  # told where the run is checked
        return
    if "manifests" in content:  # an older version knew no chain
        _tell(run.path / REPORT, content, checked)


def _check_named(places: Iterable[Place], told: Chain, checked: CheckedPart) -> None:
    for place in sorted(places, key=str):
        if is_number(place.stem) and checked.name(place).replace("\\", "/") not in told.sealed:
            try:
                _tell(place, files.read_json(place), checked)
            except ArchiveUnusable:  # told where the ledger is checked
                continue


def _check_evidence(place: Place, checked: CheckedPart) -> None:
    """What a release rests on is named for its content; who kept it where and when is not in that."""
    try:
        content = files.read_json(place)
    except ArchiveUnusable:
        checked.wrong(UNREADABLE, place, "is no manifest that can be read")
        return
    kept = {name: value for name, value in content.items() if name not in {*provenance(), ENTRY}}
    if place.stem != f"{str(kept.get('model'))[:10]}-{digest(kept)[:10]}":
        checked.wrong(EDITED, place, "was edited: its content does not make its name")


def _tell(place: Place, content: dict[str, Any], checked: CheckedPart) -> None:
    if _is_recent(str(content.get("when", ""))):
        checked.remarks.append(
            f"{checked.name(place)} is not in the chain yet: its writer is at work, or was killed just now"
        )
    else:
        checked.wrong(UNCHAINED, place, f"is in no entry of the archive's chain: {REMEDY}")


def _is_recent(when: str) -> bool:
    try:
        age = datetime.now(UTC) - datetime.fromisoformat(when)
    except (ValueError, TypeError):
        return False
    return -JUST_NOW < age < JUST_NOW
