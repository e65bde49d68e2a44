"""``tumbleline verify``: check the archive for changed, missing and foreign files, or the files of a certificate."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, TrustOption, argument, option
from pipelines.cli.printing import conclude, console, error_console, say
from pipelines.integrity import Report, verify
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.certificates.document.file_check import CheckedFile

SHOWN = 8  # consequences of one finding


PART = "Certificates, trace, audit"
ORDER = 440
SUMMARY = "Check every hash of the archive, or the files of a certificate."
EXAMPLES = ("tumbleline verify latest", "tumbleline verify certificates/SN1_1.pdf --trust laboratory.pem")


def command(
    runs: Annotated[
        list[str] | None,
        argument(
            "[RUN…|FILE…]",
            "Only these runs and their captures, or files of certificates (.pdf, .xml, .sig); default: the whole archive.",
        ),
    ] = None,
    trust: TrustOption = None,
    laboratory: Annotated[
        Path | None,
        option(
            "--laboratory FILE.toml",
            "The laboratory's file, as for 'certificate write': with --archive it proves names and addresses of FILE.",
        ),
    ] = None,
    head: Annotated[str, option("--head HASH", "Hash of an entry of the chain from an earlier verification.")] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Compute every hash again: find changed bytes, missing files, edited manifests, foreign tables, false signatures.

    Each manifest must have a signature of a key of --trust, where it is given, or of the own key. Files of certificates are
    checked alone: form, schema, signatures, attachment; --trust names who may sign. With --archive the XML is made again from
    the archive and compared whole, and revoked and replaced certificates are found. Exit status 1: there are findings, or
    nothing proves where a certificate comes from.
    """
    from pipelines.archive.signatures import public_keys
    from pipelines.audit.index import check_index

    if files := certificate_files(runs or ()):
        check_certificates(files, [Path(path) for path in trust or ()], archive, laboratory, as_json=as_json)
    if laboratory:
        raise WrongUse(
            "--laboratory: no file of a certificate is given, one is needed; give FILE.pdf or FILE.xml, or leave it out"
        )
    store = Archive(archive)
    store.refuse_none()
    keys = public_keys(trust or ())
    with error_console().status("reading") as status:
        report = verify(
            store,
            runs or (),
            keys=keys,
            demanded=bool(keys),
            head=head,
            also=[check_index],
            progress=lambda done, total: status.update(f"reading {done}/{total}"),
        )
    conclude(report.document(), lambda _: _print(report), as_json=as_json, passed=report.whole)


def _print(report: Report) -> None:
    out, checked = console(), report.checked
    for finding in checked.findings:
        out.print(f"{finding.kind:<11} {finding.path} {finding.message}")
        for line in finding.consequences[:SHOWN]:
            out.print(f"            {line}", style="dim")
        if len(finding.consequences) > SHOWN:
            left = len(finding.consequences) - SHOWN
            out.print(f"            and {left} more; --json lists all", style="dim")
    for remark in checked.remarks:
        out.print(f"  {remark}", style="dim")
    rate = f"{checked.bytes / report.seconds / 1e6:.3g} MB/s"
    out.print(
        f"{number_of(report.runs, 'run')}, {number_of(report.captures, 'capture')}: {number_of(checked.tables, 'table')}, "
        f"{number_of(checked.manifests, 'manifest')}, {number_of(checked.rows, 'row')} in {report.seconds:.2f} s ({rate})"
    )
    out.print(f"signatures  {report.trust}")
    if report.head:
        out.print(f"chain       ends with {report.head}")
    verdict = number_of(len(checked.findings), "finding") if checked.findings else "nothing is wrong"
    out.print(verdict, style="bold green" if report.whole else "bold red")


ENDINGS = (".pdf", ".xml", ".sig")
STYLES = {"good": "", "bad": "bold red", "not checked": "yellow"}


def certificate_files(names: Sequence[str]) -> list[Path]:
    """The names as files of certificates; empty where none is one.

    Raises WrongUse: files and runs are mixed, or a file is not there.
    """
    files = [Path(name) for name in names if Path(name).suffix.lower() in ENDINGS]
    if not files:
        return []
    if len(files) < len(names):
        other = next(name for name in names if Path(name) not in files)
        raise WrongUse(
            f"verify: {other} is no file of a certificate, and {files[0]} is one; give files or runs, not both"
        )
    missing = [path for path in files if not path.is_file()]
    if missing:
        raise WrongUse(f"verify: {missing[0]} is not there, the file of a certificate is needed; correct the name")
    return files


def check_certificates(
    files: Sequence[Path], trust: Sequence[Path], archive: str | None, laboratory: Path | None, *, as_json: bool
) -> NoReturn:
    """Check files of certificates and print the result; a part failed where one is not accepted."""
    from pipelines.certificates.document.file_check import Against, check_file
    from pipelines.certificates.document.laboratory import read_laboratory
    from pipelines.certificates.document.signers import read_trusted

    who = None if laboratory is None else read_laboratory(laboratory)
    trusted, store = read_trusted(trust), None
    if archive is not None or os.environ.get("TUMBLELINE_ARCHIVE") or Path("archive").is_dir():
        store = Archive(archive)  # the usual one only where there is one
        store.refuse_none()
    against = Against(trusted, store, archive is not None, who)
    done = [check_file(path, against) for path in files]
    accepted = all(checked.accepted for checked in done)
    document = {"files": [_document(checked) for checked in done], "accepted": accepted}
    conclude(document, lambda _: [_print_checked(checked) for checked in done], as_json=as_json, passed=accepted)


def _document(file: "CheckedFile") -> dict[str, Any]:
    return {
        "file": file.path,
        "certificate": getattr(file.facts, "number", ""),
        **{key: getattr(file.facts, key, "") for key in ("serial", "run", "issued")},
        **{key: getattr(file, key) for key in ("signers", "checks", "proven_by", "accepted")},
    }


def _print_checked(file: "CheckedFile") -> None:
    head = f"{file.path}: certificate {file.facts.number}, unit {file.facts.serial}" if file.facts else str(file.path)
    say(head, style="bold")
    for check in file.checks:
        mark = {"good": "ok", "bad": "WRONG", "not checked": "-"}[check.state]
        say(f"  {mark:<6}{check.check:<11} {check.message}", style=STYLES[check.state])
    wrong = sum(check.state == "bad" for check in file.checks)
    if wrong:
        say(f"  not accepted: {wrong} of {len(file.checks)} checks failed", style="bold red")
    elif file.accepted:
        by = {"signature": "a trusted signature", "archive": "the archive"}
        proven = " and ".join(by[name] for name in file.proven_by)
        say(f"  accepted: nothing is wrong, proven by {proven}", style="bold green")
    else:
        say(
            f"  not accepted: nothing is wrong, and nothing shows where the file comes from; {_needed(file)}",
            style="bold yellow",
        )


def _needed(file: "CheckedFile") -> str:
    """How the origin can be proven: an archive proves the values of an XML, and nothing of the pages of a PDF."""
    signed = any(check.check == "signature" and check.state == "good" for check in file.checks)
    if file.path.suffix.lower() == ".pdf" and not signed:
        return "the pages of an unsigned PDF cannot be proven: give its XML with --archive, or ask for a signed PDF"
    if any(check.check == "laboratory" for check in file.checks):
        return "names and addresses are not proven by the archive: give --laboratory FILE, or --trust for its signature"
    return "give --trust FILE with the certificate of the laboratory's key, or --archive with --laboratory"
