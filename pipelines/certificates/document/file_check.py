"""Checks of a certificate's files as a recipient makes them: form, schema, signatures, and the archive if one is given."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from cryptography.x509 import Certificate

from pipelines.archive import Archive
from pipelines.certificates.document import signature_check
from pipelines.certificates.document.archive_comparison import compare
from pipelines.certificates.document.dcc import DocumentInvalid, validate
from pipelines.certificates.document.laboratory import LaboratoryFile
from pipelines.certificates.document.signature_check import SignatureBroken, canonical, parsed
from pipelines.certificates.document.signers import WHERE, Signer, not_trusted, time_of
from schemas.errors import WrongUse

State = Literal["good", "bad", "not checked"]

LARGEST = 64 * 1024 * 1024
VERSION = "3.0.0"


@dataclass(frozen=True)
class Check:
    """One check of a file, and a sentence about its result."""

    check: str
    state: State
    message: str


@dataclass
class CheckedFile:
    """A file of a certificate with its checks.

    facts : statements of its certificate; None if there is none that can be read
    proven_by : proofs of its origin: ``signature`` of a trusted certificate, ``archive``; empty if there is none
    """

    path: Path
    facts: signature_check.CertificateFacts | None = None
    signers: list[str] = field(default_factory=list[str])
    checks: list[Check] = field(default_factory=list[Check])
    proven_by: tuple[str, ...] = ()

    @property
    def accepted(self) -> bool:
        """Whether nothing is wrong with it and its origin is proven."""
        return bool(self.proven_by) and not any(check.state == "bad" for check in self.checks)

    def add(self, check: str, state: State, message: str) -> None:
        """Add a check."""
        self.checks.append(Check(check, state, message))


@dataclass(frozen=True)
class Against:
    """The references for a check of files.

    trusted : certificates that vouch for signers; archive : None to check the files alone
    demanded : whether the archive must know the certificate, because it was named for this check
    laboratory : the laboratory's file, to prove the texts that are not in the archive
    """

    trusted: Sequence[Certificate] = ()
    archive: Archive | None = None
    demanded: bool = False
    laboratory: LaboratoryFile | None = None


def check_file(path: Path, against: Against) -> CheckedFile:
    """The checks of a certificate's file: PDF with attached XML, XML (with ``FILE.sig`` beside it, if present), or signature.

    Raises
    ------
    WrongUse
        It cannot be read, or is too large.
    """
    data, done = _read(path), CheckedFile(path)
    try:
        root = _document(data, done, against)
        if root is None:
            return done
        done.facts = signature_check.facts_of(root)
    except SignatureBroken as problem:
        done.add("file", "bad", str(problem))
        return done
    _schema(done, root)
    _archive(done, root, against)
    if done.facts.simulated:
        done.add("origin", "good", "SIMULATED: the certificate says that no device was measured")
    return done


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > LARGEST:
            raise WrongUse(f"{WHERE}: {path} is larger than {LARGEST >> 20} MiB; give the file of a certificate")
        return path.read_bytes()
    except OSError as problem:
        raise WrongUse(f"{WHERE}: {path} cannot be read ({problem.strerror}); give the file of a certificate") from None


def _document(data: bytes, done: CheckedFile, against: Against) -> Any | None:
    """The root of the certificate's XML, after checks of its signatures; None if there is none that can be read."""
    path = done.path
    if path.suffix.lower() == ".pdf":
        return _pdf(data, done, against)
    if path.suffix.lower() == ".sig":
        return _signature(data, done, against)
    root = parsed(data)
    beside = path.with_name(f"{path.name}.sig")
    if not beside.is_file():
        done.add("signature", "not checked", f"the XML is not signed: there is no {beside.name} beside it")
        return root
    signed = _signature(_read(beside), done, against)
    if signed is not None and canonical(signed) != canonical(root):
        done.proven_by = ()
        done.add("signature", "bad", f"{beside.name} signs another document than this file")
    return root


def _signature(data: bytes, done: CheckedFile, against: Against) -> Any | None:
    try:
        signer, root = signature_check.xml_signature(data)
    except SignatureBroken as problem:
        done.add("signature", "bad", str(problem))
        return None
    done.add("signature", "good", f"the XML is as it was signed by {signer.name}")
    _trust(done, [signer], against)
    return root


def _pdf(data: bytes, done: CheckedFile, against: Against) -> Any | None:
    attached = signature_check.attachments(data)
    if len(attached) != 1:
        done.add(
            "attachment", "bad", f"the PDF has {len(attached)} attachments {signature_check.ATTACHMENT}, one is needed"
        )
        return None
    root = parsed(attached[0])
    try:
        signers = signature_check.pdf_signers(data)
    except SignatureBroken as problem:
        done.add("signature", "bad", str(problem))
        signers = []
    else:
        if signers:
            names = ", ".join(signer.name for signer in signers)
            done.add("signature", "good", f"pages and attachment are as they were signed by {names}")
            _trust(done, signers, against)
        else:
            done.add("signature", "not checked", "the PDF is not signed: nothing shows that its pages are unchanged")
    beside = done.path.with_suffix(".xml")
    if beside.is_file():
        matches = _read(beside) == attached[0]
        done.add(
            "attachment",
            "good" if matches else "bad",
            f"the attached XML is {beside.name}" if matches else f"the attached XML differs from {beside.name}",
        )
    return root


def _trust(done: CheckedFile, signers: Sequence[Signer], against: Against) -> None:
    done.signers = [signer.name for signer in signers]
    if not against.trusted:
        done.add(
            "signer", "not checked", "no trusted certificate is given: anybody can sign in this name; give --trust FILE"
        )
        return
    # the laboratory signs first; a recipient of the file may add another signature
    why = not_trusted(signers[0], against.trusted)
    if why:
        done.add("signer", "bad", f"no certificate of --trust vouches for {signers[0].name}: {why}")
        return
    done.add("signer", "good", f"a certificate of --trust vouches for {signers[0].name}; {time_of(signers[0])}")
    done.proven_by = (*done.proven_by, "signature")


def _schema(done: CheckedFile, root: Any) -> None:
    version = root.get("schemaVersion", "")
    if version != VERSION:
        done.add(
            "schema",
            "not checked",
            f"the XML is a DCC {version or 'without a version'}; the schema of {VERSION} is shipped",
        )
        return
    try:
        validate(canonical(root))
    except DocumentInvalid as problem:
        reason = str(problem).removeprefix("certificate: ").partition("; report")[0]
        done.add("schema", "bad", reason)
    except SignatureBroken as problem:
        done.add("schema", "bad", str(problem))
    else:
        done.add("schema", "good", f"the XML is valid against DCC {VERSION}")


def _archive(done: CheckedFile, root: Any, against: Against) -> None:
    if against.archive is None or done.facts is None:
        done.add(
            "archive", "not checked", "without --archive: whether the certificate was revoked or replaced is not known"
        )
        return
    compared, where = compare(root, done.facts, against.archive, against.laboratory), against.archive.root
    if not compared.known:
        named = f"certificate {done.facts.number} of unit {done.facts.serial}"
        done.add("archive", "bad" if against.demanded else "not checked", f"archive {where} has no {named}")
        return
    for text in compared.different:
        done.add("archive", "bad", text)
    if compared.ended:
        done.add("state", "bad", compared.ended)
    else:
        done.add("state", "good", compared.until or "neither revoked nor replaced, by the ledger of the archive")
    if compared.reason:
        done.add("archive", "not checked", f"the document was not compared: {compared.reason}")
        return
    if compared.different:
        return
    done.add("archive", "good", f"{compared.count} texts and numbers are those of the document of archive {where}")
    if compared.unproven:
        done.add("laboratory", "not checked", f"not proven by the archive: {compared.unproven}")
    elif done.path.suffix.lower() != ".pdf":  # the pages of an unsigned PDF may say anything
        done.proven_by = (*done.proven_by, "archive")
