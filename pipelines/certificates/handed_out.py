"""What whoever is shown or given coefficients must know of their files: who did not sign, which libraries differ."""

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
    """Files of a run, and certificates of its units, that the own key did not sign; nothing where no own key is configured.

    Parameters
    ----------
    serials : units whose certificates for the run are looked at.

    Raises
    ------
    ArchiveUnusable
        One was edited after it was signed.
    """
    keys = public_keys()
    if not keys:
        return []
    found: dict[str, list[str]] = {}
    for place in (*_manifests(run), *_certificates(run, serials)):
        state = check(files.read_json(place), keys)
        name = str(place)[len(str(run.archive.root)) :].lstrip("/\\")
        if state == BAD:
            raise ArchiveUnusable(
                f"archive: {name} was edited after it was signed; restore it from a copy, see 'tumbleline verify {run.id}'"
            )
        if state != GOOD:
            found.setdefault(state, []).append(name)
    return [
        f"{'not signed' if state == UNSIGNED else 'signed with a key that is not the own'}: {', '.join(names)}"
        for state, names in sorted(found.items())
    ]


def library_remarks(run: Run) -> list[str]:
    """Libraries of which the run's tables were made with more than one version."""
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
