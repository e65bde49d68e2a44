"""``tumbleline certificate issue``: certificates with a period of validity for the units of a run that passed."""

import re
from functools import partial
from typing import Annotated, Any

from inertial.counts import number_of
from pipelines.archive import Archive, Run
from pipelines.cli.next_commands import archive_words, command_line
from pipelines.cli.options import (
    ArchiveOption,
    JsonOption,
    ReasonOption,
    RunArgument,
    SinceOption,
    TrustOption,
    option,
)
from pipelines.cli.printing import conclude, error_console, print_table, remark, say
from schemas.errors import ArchiveUnusable

MONTHS = re.compile(r"(\d{1,3}) ?m")  # as a value of --until


def issue(
    run: RunArgument = "latest",
    units: Annotated[str, option("--units SN,…", "Certify only these units; default: all that passed.")] = "",
    since: SinceOption = "",
    until: Annotated[
        str,
        option("--until DATE|12m", "The day after the last one of validity, or months; as long as the limits allow."),
    ] = "",
    reason: ReasonOption = "",
    trust: TrustOption = None,
    archive: ArchiveOption = None,
    *,
    supersede: Annotated[bool, option("--supersede", "Also end calibrations that begin later and overlap.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Certify the units of a run that passed, with first and last day of validity.

    The run is verified first; a run with changed files is not certified. An earlier calibration of a unit ends on the day on
    which the new one begins, so that a unit has one valid calibration on each day. A unit whose certificate was revoked is not
    certified again from the same measurements, by this run or a re-run, unless --units and --reason say so. The report of the
    run is made again and names the certificates. Exit status 1: some units of the run have no certificate: they did not pass, or
    theirs was revoked.
    """
    from pipelines.archive.signatures import public_keys
    from pipelines.certificates import Ledger
    from pipelines.chain.certify import certify
    from pipelines.report import renew_report

    store = Archive(archive)
    serials = tuple(serial.strip() for serial in units.split(",")) if units else ()
    source = store.run(run)
    _print_run(source)
    months = MONTHS.fullmatch(until)
    done = certify(
        Ledger(store), source, serials, since, "" if months else until, months=int(months[1]) if months else 0, reason=reason,
        supersede=supersede, keys=public_keys() | (public_keys(trust) if trust else {}),
    )  # fmt: skip
    try:
        with error_console().status("drawing the report"):
            renew_report(source)
    except ArchiveUnusable as problem:  # the certificates are written; the old report may show other coefficients
        remark(f"certificate issue: the report was not made again: {problem}")
    certified = [{"certificate": e.certificate, **e.document(), "was_there": e in done.there} for e in done.events]
    document = {"run": source.id, "certified": certified, "left_out": done.left_out}
    conclude(document, partial(_print, archive), as_json=as_json, passed=not done.left_out)


def _print_run(run: Run) -> None:
    from pipelines.certificates.coefficient_remarks import library_remarks
    from pipelines.certificates.measured import measured_on

    units = [str(unit["serial"]) for unit in run.about.get("lot", {}).get("units", [])]
    named = ", ".join(units) if len(units) <= 6 else f"{units[0]} … {units[-1]}"
    counted = number_of(len(units), "unit")
    for line in (f"run {run.id}, measured on {measured_on(run)}, {counted}: {named}", *library_remarks(run)):
        remark(f"certificate issue: {line}")


def _print(archive: str | None, document: dict[str, Any]) -> None:
    lines = [
        [e["certificate"], e["grade"], e["from"], e["until"], "already certified" if e["was_there"] else e["action"],
         ", ".join(f"/{number}" for number in e["ends"])]
        for e in sorted(document["certified"], key=lambda entry: entry["serial"])
    ]  # fmt: skip
    if lines:
        print_table(["certificate", "grade", "from", "until", "entry", "ends"], lines, title=f"run {document['run']}")
        say(
            f"The documents: {command_line('certificate', 'write', document['run'], *archive_words(archive))} --laboratory FILE "
            "(docs/how-to/issue-a-certificate.md)",
            style="dim",
        )
    for serial, why in document["left_out"].items():
        say(f"  {serial} not certified: {why}")
