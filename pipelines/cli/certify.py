"""``tumbleline certify``: a run's units that passed get a validity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, RunArgument, console, print_json, print_table

if TYPE_CHECKING:
    from pipelines.certificates.certify import Certified

PART = "Certificates, trace, audit"
ORDER = 410
SUMMARY = "Certify the units of a run that passed, from a first to a last day of validity."


def command(
    run: RunArgument = "latest",
    units: Annotated[str, typer.Option("--units", metavar="SN,…", help="Only these; all that passed by default.")] = "",
    start: Annotated[str, typer.Option("--from", metavar="DATE", help="First day of validity, UTC; today.")] = "",
    until: Annotated[str, typer.Option("--until", metavar="DATE", help="The day after the last.")] = "",
    months: Annotated[int, typer.Option("--months", min=1, max=1200, help="Validity where no --until is given.")] = 12,
    reason: Annotated[str, typer.Option("--reason", help="Kept with the event.")] = "",
    archive: ArchiveOption = None,
    *,
    supersede: Annotated[
        bool, typer.Option("--supersede", help="End calibrations that begin later and overlap, too.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Certify the units of a run that passed: from when until when their calibration holds.

    A calibration that began earlier ends where the new one begins; of one unit no two hold on one day. The run's report is made
    again and names the certificates. Exit status 1: some
    units of the run did not pass and got no certificate.
    """
    from pipelines.archive import Archive
    from pipelines.certificates import Ledger
    from pipelines.report import renew_report
    from schemas.errors import DONE, PART_FAILED

    store = Archive(archive)
    serials = tuple(serial.strip() for serial in units.split(",")) if units else ()
    found = store.run(run)
    done = Ledger(store).certify(
        found, serials, start, until, months=months, reason=reason, supersede=supersede
    )  # fmt: skip
    renew_report(found)
    if as_json:
        print_json(_document(found.id, done))
    else:
        _print(found.id, done)
    raise typer.Exit(PART_FAILED if done.left_out else DONE)


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
