"""``tumbleline certify``: certificates with a period of validity for the units of a run that passed."""

from typing import Annotated, Any

from inertial.counts import number_of
from pipelines.archive import Archive, Run
from pipelines.cli.options import ArchiveOption, JsonOption, RunArgument, option
from pipelines.cli.printing import conclude, error_console, print_table, remark, say
from schemas.errors import ArchiveUnusable

PART = "Certificates, trace, audit"
ORDER = 410
SUMMARY = "Certify the units of a run that passed, for a period of validity."
EXAMPLES = ("tumbleline certify latest --months 12", "tumbleline certify latest --units SN1")


def command(
    run: RunArgument = "latest",
    units: Annotated[str, option("--units SN,…", "Certify only these units; default: all that passed.")] = "",
    start: Annotated[str, option("--from DATE", "First day of validity, UTC; default: today.")] = "",
    until: Annotated[str, option("--until DATE", "The day after the last day of validity.")] = "",
    months: Annotated[
        int, option("--months", "Validity without --until, months; 0: as long as the limits allow.", min=0, max=120)
    ] = 0,
    reason: Annotated[str, option("--reason", "Reason, written into the certificate's entry of the ledger.")] = "",
    key: Annotated[
        list[str] | None, option("--key FILE|HEX", "Another public key that is accepted for the signatures of the run.")
    ] = None,
    archive: ArchiveOption = None,
    *,
    supersede: Annotated[bool, option("--supersede", "Also end calibrations that begin later and overlap.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Certify the units of a run that passed, with first and last day of validity.

    The run is verified first; a run with changed files is not certified. An earlier calibration of a unit ends on the day on
    which the new one begins, so that a unit has one valid calibration on each day. The report of the run is made again and names
    the certificates. Exit status 1: some units of the run did not pass and have no certificate.
    """
    from pipelines.archive.signatures import public_keys
    from pipelines.certificates import Ledger
    from pipelines.chain.certify import certify
    from pipelines.report import renew_report

    store = Archive(archive)
    serials = tuple(serial.strip() for serial in units.split(",")) if units else ()
    source = store.run(run)
    _print_run(source)
    done = certify(Ledger(store), source, serials, start, until, months=months, reason=reason, supersede=supersede,
        keys=public_keys() | (public_keys(key) if key else {}),
    )  # fmt: skip
    try:
        with error_console().status("drawing the report"):
            renew_report(source)
    except ArchiveUnusable as problem:  # the certificates are written; the old report may show other coefficients
        remark(f"certify: the report was not made again: {problem}")
    certified = [{"certificate": e.certificate, **e.document(), "was_there": e in done.there} for e in done.events]
    document = {"run": source.id, "certified": certified, "left_out": done.left_out}
    conclude(document, _print, as_json=as_json, passed=not done.left_out)


def _print_run(run: Run) -> None:
    from pipelines.certificates.coefficient_remarks import library_remarks
    from pipelines.certificates.measured import measured_on

    units = [str(unit["serial"]) for unit in run.about.get("lot", {}).get("units", [])]
    named = ", ".join(units) if len(units) <= 6 else f"{units[0]} … {units[-1]}"
    counted = number_of(len(units), "unit")
    for line in (f"run {run.id}, measured on {measured_on(run)}, {counted}: {named}", *library_remarks(run)):
        remark(f"certify: {line}")


def _print(document: dict[str, Any]) -> None:
    lines = [
        [e["certificate"], e["grade"], e["from"], e["until"], "already certified" if e["was_there"] else e["action"],
         ", ".join(f"/{number}" for number in e["ends"])]
        for e in sorted(document["certified"], key=lambda entry: entry["serial"])
    ]  # fmt: skip
    if lines:
        print_table(["certificate", "grade", "from", "until", "entry", "ends"], lines, title=f"run {document['run']}")
        say(
            f"The documents: tumbleline certificate {document['run']} --laboratory FILE (docs/how-to/issue-a-certificate.md)",
            style="dim",
        )
    for serial, why in document["left_out"].items():
        say(f"  {serial} not certified: {why}")
