"""Writing the files of chosen certificates, all or none of each; the PDF is typeset by typst."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from typing import Any

from pipelines.archive import Archive, Run, files
from pipelines.certificates import Calibration, Ledger
from pipelines.certificates.document.compose import compose
from pipelines.certificates.document.content import CertificateContent
from pipelines.certificates.document.dcc import EXTRA, WHERE, dcc
from pipelines.certificates.document.laboratory import LaboratoryFile
from pipelines.certificates.document.pages import page_content
from pipelines.certificates.document.signing import SigningKey, sign_pdf, sign_xml
from pipelines.tables.frames import rows_of
from schemas.errors import WrongUse
from schemas.library import library


def pdf(content: CertificateContent, xml: bytes, address: str = "") -> bytes:
    """The PDF of a certificate.

    The document claims PDF/A-3b; typst refuses to write what breaks the rules that it knows. That claim has not been checked with
    an independent validator (veraPDF).

    Parameters
    ----------
    xml : of the same content, attached as its alternative form.
    address : printed as a QR code; none where empty.

    Raises
    ------
    WrongUse
        typst, or segno for a QR code, is not installed.
    """
    typst = library("typst", EXTRA, WHERE)
    qr = library("segno", EXTRA, WHERE).make(address, error="m", micro=False).svg_inline(border=1) if address else ""
    inputs: dict[str, Any] = page_content(content) | {"qr": qr}
    compiler = typst.Compiler(
        (resources.files("pipelines.certificates.document") / "certificate.typ").read_bytes(),
        font_paths=typst.Fonts(include_system_fonts=False, include_embedded_fonts=True),
        sys_inputs={"content": json.dumps(inputs), "xml": xml.decode("utf-8")},
    )
    issued = datetime.fromisoformat(content.issued).replace(tzinfo=UTC)
    return compiler.compile(format="pdf", pdf_standards="a-3b", timestamp=issued)


@dataclass(frozen=True)
class Written:
    """The files of a certificate; signature : the detached one of the XML."""

    number: str
    serial: str
    run: str
    pdf: Path
    xml: Path
    signature: Path | None


@dataclass
class Issued:
    """The certificates written; by serial, the reasons for units left out."""

    written: list[Written] = field(default_factory=list[Written])
    left_out: dict[str, str] = field(default_factory=dict[str, str])


def issue(
    archive: Archive,
    names: Sequence[str],
    who: LaboratoryFile,
    folder: Path,
    *,
    key: SigningKey | None = None,
    address: str = "",
) -> Issued:
    """Write the chosen certificates into a folder.

    Parameters
    ----------
    names : runs, serials, numbers of certificates.
    key : signs both files; address : of a QR code, ``{number}`` is filled in.

    Raises
    ------
    WrongUse
        A unit that is named has no certificate, one was revoked, or the folder cannot be written.
    """
    chosen, done = _chosen(archive, names)
    contents = [compose(Run(archive, calibration.run), calibration, known, who) for calibration, known in chosen]
    made: list[tuple[Calibration, dict[str, bytes]]] = []
    for (calibration, _), content in zip(chosen, contents, strict=True):  # all exist before any file is written
        xml = dcc(content)
        document = pdf(content, xml, address.replace("{number}", content.number))
        parts = {"xml": xml, "pdf": document}
        if key is not None:
            parts["pdf"] = sign_pdf(document, key)
            parts["xml.sig"] = sign_xml(xml, key)
        made.append((calibration, parts))
    for entry, parts in made:
        stem = entry.certificate.replace("/", "_")
        paths = {end: folder / f"{stem}.{end}" for end in parts}
        for end, data in parts.items():
            files.publish(paths[end], data, WHERE, "give another folder with --output")
        done.written.append(
            Written(entry.certificate, entry.serial, entry.run, paths["pdf"], paths["xml"], paths.get("xml.sig"))
        )
    return done


def _chosen(archive: Archive, names: Sequence[str]) -> tuple[list[tuple[Calibration, list[Calibration]]], Issued]:
    ledger, done = Ledger(archive), Issued()
    chosen: dict[str, tuple[Calibration, list[Calibration]]] = {}
    for name in names:
        serial, _, number = name.rpartition("/") if "/" in name else (name, "", "")
        known = ledger.calibrations(serial)
        if known:
            chosen |= {entry.certificate: (entry, known) for entry in _of_unit(serial, known, number)}
        elif number or any(name in info.units for info in archive.runs()):
            raise WrongUse(f"certificate: unit {serial} has no certificate, one is needed; {_why(archive, serial)}")
        else:
            chosen |= _of_run(ledger, archive.run(name, or_unit=True), done)
    return list(chosen.values()), done


def _of_unit(serial: str, known: list[Calibration], number: str) -> list[Calibration]:
    """The certificate of a unit with a number; without a number all that are valid, one of each subject, else the last."""
    if number:
        meant = [calibration for calibration in known if str(calibration.event.sequence) == number]
        if not meant:
            listed = ", ".join(calibration.certificate for calibration in known)
            raise WrongUse(f"certificate: {serial}/{number} is not in the ledger, there are {listed}; give one of them")
        return meant
    return [calibration for calibration in known if calibration.state == "valid"] or known[-1:]


def _of_run(ledger: Ledger, run: Run, done: Issued) -> dict[str, tuple[Calibration, list[Calibration]]]:
    """The last certificate of every unit of a run; the units that have none are left out with the reason."""
    reasons = _reasons(run)
    certificates: dict[str, tuple[Calibration, list[Calibration]]] = {}
    for serial, reason in reasons.items():
        known = ledger.calibrations(serial)
        of_run = [calibration for calibration in known if calibration.run == run.id]
        standing = [calibration for calibration in of_run if calibration.state != "revoked"]
        if standing:
            certificates[standing[-1].certificate] = standing[-1], known
        elif of_run:
            done.left_out[serial] = f"{of_run[-1].sentence()}; measure the unit again"
        else:
            done.left_out[serial] = (
                reason or f"passed and not certified; certify it with 'tumbleline certificate issue {run.id}'"
            )
    if not certificates:
        listed = "; ".join(f"{serial}: {why}" for serial, why in done.left_out.items()) or "it has no grades"
        raise WrongUse(f"certificate: no unit of run {run.id} has a certificate, one is needed ({listed})")
    return certificates


def _reasons(run: Run) -> dict[str, str]:
    """The reason why each unit of a run cannot be certified, by serial; empty for a unit that passed."""
    rows = rows_of(run.table("grades")) if "grades" in run.tables() else []
    return {
        str(row["unit"]): "" if row["outcome"] == "pass" else f"{row['outcome']}, no certificate: {row['reasons']}"
        for row in rows
    }


def _why(archive: Archive, serial: str) -> str:
    """The reason why a unit has no certificate, from the last run that graded it."""
    for info in reversed([info for info in archive.runs() if serial in info.units]):
        run = Run(archive, info.id)
        reason = _reasons(run).get(serial)
        if reason:
            return f"run {run.id}: {reason}"
        if reason is not None:
            return f"it passed: certify it with 'tumbleline certificate issue {run.id}' first"
    return archive.units_like(serial) or "see 'tumbleline list'"
