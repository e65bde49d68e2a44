"""A certificate's XML against the archive: its entry in the ledger, whether it still holds, and its numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pipelines.archive import Archive, Run
from pipelines.certificate_document.compose import compose
from pipelines.certificate_document.dcc import dcc
from pipelines.certificate_document.laboratory import LaboratoryFile
from pipelines.certificate_document.signature_check import parsed
from pipelines.certificate_document.xml_facts import facts_of
from pipelines.certificates import Ledger
from pipelines.certificates.days import today
from schemas.errors import ArchiveUnusable, TumblelineError

if TYPE_CHECKING:
    from pipelines.certificate_document.xml_facts import CertificateFacts
    from pipelines.certificates import Calibration

NOBODY = LaboratoryFile.model_validate(
    {
        "laboratory": {"name": "-", "address": "-", "country": "DE", "email": "-@-"},
        "customer": {"name": "-", "address": "-", "email": "-@-"},
        "signatory": {"name": "-", "role": "-"},
        "item": {"manufacturer": "-"},
    }
)
"""Stands where the laboratory's file is not needed: names and addresses are not compared."""
SHOWN = 3  # different numbers that are named


@dataclass(frozen=True)
class Compared:
    """What the archive says of a certificate.

    known : whether the ledger has its number; ended : why it is not valid any more, empty where it is
    until : until when it is valid and what comes then, where that is known already
    different : sentences about what differs; count : numbers that were compared
    reason : why the numbers could not be compared, empty where they were
    """

    known: bool
    ended: str = ""
    until: str = ""
    different: tuple[str, ...] = ()
    reason: str = ""
    count: int = 0


def compare(facts: CertificateFacts, archive: Archive) -> Compared:
    """What the archive says of a certificate with these facts."""
    known = Ledger(archive).calibrations(facts.serial) if facts.serial else []
    own = next((one for one in known if one.certificate == facts.number), None)
    if own is None:
        return Compared(known=False)
    different: list[str] = []
    for what, found, needed in (
        ("run", facts.run, own.run),
        ("SHA-256 of the coefficients", facts.coefficients, own.event.coefficients),
        ("date of issue", facts.issued, own.event.when[:10]),
    ):
        if found != needed:
            different.append(f"{what}: the file says {found or 'nothing'}, the ledger {needed}")
    try:
        valid = replace(own, ended_by=None)  # its numbers are those of the day of issue, also after a revocation
        content = compose(Run(archive, own.run), valid, known, NOBODY)
    except ArchiveUnusable as problem:
        return Compared(True, *_ended(own), (*different, str(problem)))
    except TumblelineError as problem:
        return Compared(True, *_ended(own), tuple(different), reason=str(problem))
    there = facts_of(parsed(dcc(content)))
    if facts.measured != there.measured:
        different.append(
            f"dates of calibration: the file says {' to '.join(facts.measured)}, the archive {' to '.join(there.measured)}"
        )
    different += _numbers(facts, there)
    for text in dict.fromkeys([*facts.conformity, *there.conformity]):
        here, needed = (one.conformity.get(text, "nothing") for one in (facts, there))
        if here != needed:
            different.append(f"decision '{text}': the file says {here}, the archive {needed}")
    return Compared(True, *_ended(own), tuple(different), count=len(there.numbers))


def _numbers(here: CertificateFacts, there: CertificateFacts) -> list[str]:
    names = [
        name
        for name in dict.fromkeys([*here.numbers, *there.numbers])
        if here.numbers.get(name) != there.numbers.get(name)
    ]
    lines = [
        f"{name}: the file says {_text(here.numbers.get(name))}, the archive {_text(there.numbers.get(name))}"
        for name in names[:SHOWN]
    ]
    return [*lines, f"and {len(names) - SHOWN} other numbers"] if len(names) > SHOWN else lines


def _text(number: tuple[str, ...] | None) -> str:
    if number is None:
        return "nothing"
    value, unit, expanded, _ = number
    return f"{value} ± {expanded} {unit}" if expanded else f"{value} {unit}"


def _ended(one: Calibration) -> tuple[str, str]:
    """Why a calibration is not valid any more, and until when it still is where its end is known; each may be empty."""
    by = one.ended_by
    if by is None:
        return "", ""
    reason = f": {by.reason}" if by.reason else ""
    if by.action == "revoke":
        return f"revoked on {by.when[:10]} by {by.who}, not valid from {one.until} on{reason}", ""
    amended = "amended and replaced" if by.run == one.run else "superseded"
    text = f"{amended} by certificate {by.certificate} on {by.when[:10]}, not valid from {one.until} on{reason}"
    return ("", text) if today() < one.until else (text, "")
