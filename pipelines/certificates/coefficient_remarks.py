"""Remarks for readers of coefficients: missing or foreign signatures, and differing versions of libraries."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.archive import files
from pipelines.archive.signatures import BAD, GOOD, UNSIGNED, check, public_keys
from pipelines.certificates.entries import folder_of
from pipelines.certificates.ledger import Ledger
from pipelines.certificates.libraries import differing_libraries
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pipelines.archive import Run
    from pipelines.archive.store import Place

TABLES = ("coefficients", "covariance", "grades")


def signature_remarks(run: Run, serials: Iterable[str] = ()) -> list[str]:
    """Files of a run, and certificates of its units, without a signature of the own key; empty without an own key.

    Parameters
    ----------
    serials : units whose certificates for the run are checked.

    Raises
    ------
    ArchiveUnusable
        A file was edited after it was signed.
    """
    keys = public_keys()
    if not keys:
        return []
    by_state: dict[str, list[str]] = {}
    for place in (*_manifests(run), *_certificates(run, serials)):
        state = check(files.read_json(place), keys)
        name = str(place)[len(str(run.archive.root)) :].lstrip("/\\")
        if state == BAD:
            raise ArchiveUnusable(
                f"archive: {name} was edited after it was signed; restore it from a copy, see 'tumbleline verify {run.id}'"
            )
        if state != GOOD:
            by_state.setdefault(state, []).append(name)
    return [
        f"{'not signed' if state == UNSIGNED else 'signed with a key that is not the own'}: {', '.join(names)}"
        for state, names in sorted(by_state.items())
    ]


def library_remarks(run: Run) -> list[str]:
    """Libraries with more than one version among the tables of the run."""
    there = [name for name in run.tables() if (run.path / f"{name}.json").is_file()]
    return differing_libraries(run.id, {name: run.manifest(name) for name in there})


def _manifests(run: Run) -> list[Place]:
    places = [run.path / f"{name}.json" for name in ("run", *TABLES)]
    return [place for place in places if place.is_file()]


def _certificates(run: Run, serials: Iterable[str]) -> list[Place]:
    ledger, root = Ledger(run.archive.root), run.archive.root
    return [
        root / folder_of(serial) / f"{one.event.sequence:06d}.json"
        for serial in serials
        for one in ledger.calibrations(serial)
        if one.run == run.id
    ]
