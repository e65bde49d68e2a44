"""Entries of the ledger of a unit's calibrations: one event per file, never changed."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_args

from pipelines.archive.hash_chain import is_number
from pipelines.archive.store import Place
from schemas.errors import ArchiveUnusable

SCHEMA = 1
STATIC = "static"
WRITING = "coefficients are written into the device"
"""The reason of a revocation that lasts until the memory of a unit is verified."""
Action = Literal["certify", "supersede", "revoke"]


@dataclass(frozen=True)
class LedgerEntry:
    """One event of a unit's calibrations.

    ``certify`` begins the validity of a calibration, ``supersede`` also ends others, ``revoke`` only ends calibrations.

    Parameters
    ----------
    sequence : number of the event of the unit, from 1; a calibration has the sequence of the event that began it.
    start, until : validity, first day and the day after the last; a revocation ends validity with ``start``.
    ends : sequences of the calibrations that end with ``start``.
    coefficients : hash of the certified table: of the coefficients, of a run without any of ``procedure_results``.
    evidence : hashes of the manifests of the run that support the decision, by table.
    previous : hash of the file of the unit's previous event; empty for the first.
    adequacy : verdict on the run's model with its p, as it was certified; empty in events of earlier versions.
    covers : ``static`` (coefficients) and procedures whose results by comparison it states, separated by blanks; a calibration
        ends earlier ones that cover any of the same.
    """

    serial: str
    sequence: int
    action: Action
    device: str
    run: str
    start: str
    until: str
    grade: str
    station: str
    recipe: str
    coefficients: str
    ends: tuple[int, ...]
    who: str
    where: str
    when: str
    reason: str
    previous: str
    evidence: tuple[tuple[str, str], ...] = ()
    adequacy: str = ""
    covers: str = STATIC

    def ends_others_of(self, other: "LedgerEntry") -> bool:
        """Whether it covers any of what another event covers."""
        return bool(set(self.covers.split()) & set(other.covers.split()))

    @property
    def table(self) -> str:
        """The table that it certifies."""
        return "coefficients" if STATIC in self.covers.split() else "procedure_results"

    @property
    def certificate(self) -> str:
        """Number of the certificate of this event: serial and sequence."""
        return f"{self.serial}/{self.sequence}"

    def document(self) -> dict[str, Any]:
        """The event as it is written to the file."""
        content = asdict(self)
        content["from"] = content.pop("start")
        return {**content, "ends": list(self.ends), "evidence": dict(self.evidence), "schema": SCHEMA}


_NAMES = {field.name for field in fields(LedgerEntry)}


def event_of(content: Mapping[str, Any], where: str) -> LedgerEntry:
    """The event with the content of a file; refuses content that is no event or has a newer schema.

    Parameters
    ----------
    where : the file, for messages.
    """
    schema = content.get("schema")
    if isinstance(schema, int) and schema > SCHEMA:
        raise ArchiveUnusable(
            f"calibrations: {where} has schema {schema}, this version knows up to {SCHEMA}; use a newer version"
        )
    known: dict[str, Any] = {"adequacy": "", "covers": STATIC}  # events of earlier versions have none
    known |= {("start" if name == "from" else name): value for name, value in content.items()}
    missing = sorted(_NAMES - known.keys())
    if missing or known["action"] not in get_args(Action):
        fault = f"no {missing[0]}" if missing else f"action {known['action']!r}"
        raise ArchiveUnusable(f"calibrations: {where} is no event of this ledger ({fault}); restore it from a copy")
    known["ends"] = tuple(known["ends"])
    known["evidence"] = tuple(sorted(known["evidence"].items()))
    return LedgerEntry(**{name: known[name] for name in _NAMES})


FOLDER = "calibrations"


def folder_of(serial: str) -> str:
    """Folder of a unit's events below the archive's root."""
    name = hashlib.sha256(serial.encode("utf-8", "surrogateescape")).hexdigest()
    return f"{FOLDER}/{name[:2]}/{name[:16]}"


def numbered_files(folder: Place) -> list[Place]:
    """The files ``<number>.json`` of a unit's folder in order; none where there is no folder."""
    if isinstance(folder, Path) and not folder.is_dir():
        return []
    files = {path.name: path for path in folder.iterdir() if path.name.endswith(".json")}
    return [files[name] for name in sorted(files) if is_number(name.removesuffix(".json"))]
