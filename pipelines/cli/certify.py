"""``tumbleline certify``: a run's units that passed get a validity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import (
    ArchiveOption,
    JsonOption,
    RunArgument,
    console,
    error_console,
    print_json,
    print_table,
)

if TYPE_CHECKING:
    from pipelines.archive import Run
    from pipelines.chain.certify import Certified

PART = "Certificates, trace, audit"
ORDER = 410
SUMMARY = "Certify the units of a run that passed, from a first to a last day of validity."
EXAMPLES = (
    "tumbleline certify latest --months 12",
    "tumbleline certify latest --units SN1",
)


def command(
    run: RunArgument = "latest",
    units: Annotated[str, typer.Option("--units", metavar="SN,…", help="Only these; all that passed by default.")] = "",
    start: Annotated[str, typer.Option("--from", metavar="DATE", help="First day of validity, UTC; today.")] = "",
    until: Annotated[str, typer.Option("--until", metavar="DATE", help="The day after the last.")] = "",
    months: Annotated[
        int,
        typer.Option(
            "--months", min=0, max=120, help="Validity where no --until is given; 0: as long as the limits allow."
        ),
    ] = 0,
    reason: Annotated[str, typer.Option("--reason", help="Kept with the event.")] = "",
    key: Annotated[
        list[str] | None,
        typer.Option("--key", metavar="FILE|HEX", help="A public key that may have signed the run, beside the own."),
    ] = None,
    archive: ArchiveOption = None,
    *,
    supersede: Annotated[
        bool, typer.Option("--supersede", help="End calibrations that begin later and overlap, too.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Certify the units of a run that passed: from when until when their calibration holds.

    The run is verified first; what is not as it was written is not certified. A calibration that began earlier ends where the new
    one begins; of one unit no two hold on one day. The run's report is made again and names the certificates. Exit status 1: some
    units of the run did not pass and got no certificate.
    """
    from pipelines.archive import Archive
    from pipelines.archive.signatures import public_keys
    from pipelines.certificates import Ledger
    from pipelines.chain.certify import certify
    from pipelines.report import renew_report
    from schemas.errors import DONE, PART_FAILED, ArchiveUnusable

    store = Archive(archive)
    serials = tuple(serial.strip() for serial in units.split(",")) if units else ()
    found = store.run(run)
    _tell_which(found)
    done = certify(Ledger(store), found, serials, start, until, months=months, reason=reason, supersede=supersede,
        keys=public_keys() | (public_keys(key) if key else {}),
    )  # fmt: skip
    try:
        renew_report(found)
    except ArchiveUnusable as problem:  # the certificates are written; an older one may be of other coefficients
        error_console().print(f"certify: the report was not made again: {problem}", markup=False, soft_wrap=True)
    if as_json:
        print_json(_document(found.id, done))
    else:
        _print(found.id, done)
    raise typer.Exit(PART_FAILED if done.left_out else DONE)


def _tell_which(run: Run) -> None:
    """Say which run is about to be signed, on the error stream, before it is."""
    from pipelines.certificates.handed_out import library_remarks
    from pipelines.certificates.measured import measured_on

    units = [str(unit["serial"]) for unit in run.about.get("lot", {}).get("units", [])]
    named = ", ".join(units) if len(units) <= 6 else f"{units[0]} … {units[-1]}"
    lines = [f"run {run.id}, measured on {measured_on(run)}, {len(units)} units: {named}", *library_remarks(run)]
    for line in lines:
        error_console().print(f"certify: {line}", markup=False, soft_wrap=True)


def _document(run: str, done: Certified) -> dict[str, Any]:
    there = {event.certificate for event in done.there}
    return {
        "run": run,
        "certified": [
            {"certificate": e.certificate, **e.document(), "was_there": e.certificate in there} for e in done.events
        ],
        "left_out": done.left_out,
    }


def _print(run: str, done: Certified) -> None:
    there = {event.certificate for event in done.there}
    lines = [
        [e.certificate, e.grade, e.start, e.until, "was there" if e.certificate in there else e.action, _ended(e.ends)]
        for e in sorted(done.events, key=lambda event: event.serial)
    ]
    if lines:
        print_table(["certificate", "grade", "from", "until", "", "ends"], lines, title=f"run {run}")
    for serial, why in done.left_out.items():
        console().print(f"  {serial} not certified: {why}", markup=False, soft_wrap=True)


def _ended(sequences: tuple[int, ...]) -> str:
    return ", ".join(f"/{number}" for number in sequences)
