"""``tumbleline verify``: check the archive for changed, missing and foreign files, or the files of a certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import conclude, console, error_console
from pipelines.integrity import Report
from schemas.errors import DONE, PART_FAILED, WrongUse

SHOWN = 8  # consequences of one finding


PART = "Certificates, trace, audit"
ORDER = 440
SUMMARY = "Check every hash of the archive, or the files of a certificate."
EXAMPLES = (
    "tumbleline verify latest",
    "tumbleline verify certificates/SN1_1.pdf --trust laboratory.pem",
)


def command(
    runs: Annotated[
        list[str] | None,
        argument(
            "[RUN…|FILE…]",
            "Only these runs and their captures, or files of certificates (.pdf, .xml, .sig); default: the whole archive.",
        ),
    ] = None,
    trust: Annotated[
        list[Path] | None,
        option(
            "--trust FILE.pem",
            "Certificate of a laboratory's key, or of its authority, that vouches for the signatures of FILE.",
        ),
    ] = None,
    laboratory: Annotated[
        Path | None,
        option(
            "--laboratory FILE.toml",
            "The laboratory's file, as for 'certificate': with --archive it proves names and addresses of FILE.",
        ),
    ] = None,
    key: Annotated[
        list[str] | None,
        option(
            "--key FILE|HEX",
            "A public key; each manifest must have a signature of one of these keys. Default: the own key.",
        ),
    ] = None,
    head: Annotated[str, option("--head HASH", "Hash of an entry of the chain from an earlier verification.")] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Compute every hash again: find changed bytes, missing files, edited manifests, foreign tables, false signatures.

    Files of certificates are checked alone: form, schema, signatures, attachment. --trust decides who may sign. With --archive
    the XML is made again from the archive and compared whole, and revoked and replaced certificates are found. Exit status 1:
    there are findings, or nothing proves where a certificate comes from.
    """
    from pipelines.archive.signatures import public_keys
    from pipelines.audit.index import check_index
    from pipelines.cli.certificate_check import certificate_files, check_certificates
    from pipelines.integrity import verify

    if files := certificate_files(runs or ()):
        accepted = check_certificates(files, trust or (), archive, laboratory, as_json=as_json)
        raise typer.Exit(DONE if accepted else PART_FAILED)
    if trust or laboratory:
        raise WrongUse(
            f"{'--trust' if trust else '--laboratory'}: no file of a certificate is given, one is needed; give FILE.pdf or "
            "FILE.xml, or leave it out"
        )
    store = Archive(archive)
    store.refuse_none()
    keys = public_keys(key or ())
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
        f"{number_of(checked.manifests, 'manifest')}, {number_of(checked.rows, 'row')} in {report.seconds:.2f} s ({rate})",
    )
    out.print(f"signatures  {report.trust}")
    if report.head:
        out.print(f"chain       ends with {report.head}")
    verdict = number_of(len(checked.findings), "finding") if checked.findings else "nothing is wrong"
    out.print(verdict, style="bold green" if report.whole else "bold red")
