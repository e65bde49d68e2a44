"""The check of certificate files by ``tumbleline verify FILE…``, as text and as JSON."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import Archive
from pipelines.cli.printing import print_json, say
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.certificates.document.file_check import CheckedFile

ENDINGS = (".pdf", ".xml", ".sig")
STYLES = {"good": "", "bad": "bold red", "not checked": "yellow"}


def certificate_files(names: Sequence[str]) -> list[Path]:
    """The names as files of certificates; empty where none is one.

    Raises
    ------
    WrongUse
        Files and runs are mixed, or a file is not there.
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
) -> bool:
    """Check files of certificates and print the result; whether all are accepted."""
    from pipelines.certificates.document.file_check import Against, check_file
    from pipelines.certificates.document.laboratory import read_laboratory
    from pipelines.certificates.document.signers import read_trusted

    who = None if laboratory is None else read_laboratory(laboratory)
    against = Against(read_trusted(trust), _archive(archive), archive is not None, who)
    done = [check_file(path, against) for path in files]
    accepted = all(one.accepted for one in done)
    if as_json:
        print_json({"files": [_document(one) for one in done], "accepted": accepted})
    else:
        for one in done:
            _print(one)
    return accepted


def _archive(name: str | None) -> Archive | None:
    """The archive that is given, or the usual one where there is one."""
    if name is None and not os.environ.get("TUMBLELINE_ARCHIVE") and not Path("archive").is_dir():
        return None
    archive = Archive(name)
    archive.refuse_none()
    return archive


def _document(one: CheckedFile) -> dict[str, Any]:
    facts = one.facts
    return {
        "file": str(one.path),
        "certificate": "" if facts is None else facts.number,
        "serial": "" if facts is None else facts.serial,
        "run": "" if facts is None else facts.run,
        "issued": "" if facts is None else facts.issued,
        "signers": one.signers,
        "checks": [{"check": c.check, "state": c.state, "message": c.message} for c in one.checks],
        "proven_by": list(one.proven_by),
        "accepted": one.accepted,
    }


def _print(one: CheckedFile) -> None:
    head = f"{one.path}: certificate {one.facts.number}, unit {one.facts.serial}" if one.facts else str(one.path)
    say(head, style="bold")
    for check in one.checks:
        mark = {"good": "ok", "bad": "WRONG", "not checked": "-"}[check.state]
        say(f"  {mark:<6}{check.check:<11} {check.message}", style=STYLES[check.state])
    wrong = sum(check.state == "bad" for check in one.checks)
    if wrong:
        say(f"  not accepted: {wrong} of {len(one.checks)} checks failed", style="bold red")
    elif one.accepted:
        by = {"signature": "a trusted signature", "archive": "the archive"}
        proven = " and ".join(by[name] for name in one.proven_by)
        say(f"  accepted: nothing is wrong, proven by {proven}", style="bold green")
    else:
        say(
            f"  not accepted: nothing is wrong, and nothing shows where the file comes from; {_needed(one)}",
            style="bold yellow",
        )


def _needed(one: CheckedFile) -> str:
    """What would prove the origin: an archive proves the values of an XML, and nothing of the pages of a PDF."""
    signed = any(check.check == "signature" and check.state == "good" for check in one.checks)
    if one.path.suffix.lower() == ".pdf" and not signed:
        return "the pages of an unsigned PDF cannot be proven: give its XML with --archive, or ask for a signed PDF"
    if any(check.check == "laboratory" for check in one.checks):
        return "names and addresses are not proven by the archive: give --laboratory FILE, or --trust for its signature"
    return "give --trust FILE with the certificate of the laboratory's key, or --archive with --laboratory"
