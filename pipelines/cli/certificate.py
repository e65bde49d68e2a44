"""``tumbleline certificate``: the certificates of units: issued for a period, listed, written as documents, revoked."""

from pathlib import Path
from typing import Annotated

import typer

from inertial.counts import number_of
from pipelines.archive import Archive, Run
from pipelines.cli.certificate_issue import issue
from pipelines.cli.groups import group
from pipelines.cli.next_commands import archive_words, command_line
from pipelines.cli.options import ArchiveOption, JsonOption, ReasonOption, argument, option
from pipelines.cli.printing import give, print_table, refuse_standard_output, remark, say
from schemas.errors import DONE, PART_FAILED

PART = "Certificates, trace, audit"
ORDER = 410
SUMMARY = "Issue certificates for a period, list them, write them as documents, revoke them."
EXAMPLES = (
    "tumbleline certificate issue latest --until 12m",
    "tumbleline certificate write latest --laboratory laboratory.toml --output certificates",
)
EXAMPLES_OF = {
    "issue": ("tumbleline certificate issue latest --until 12m", "tumbleline certificate issue latest --units SN1"),
    "write": (
        "tumbleline certificate write latest --laboratory laboratory.toml --output certificates",
        "tumbleline certificate write SN1 --laboratory laboratory.toml --output certificates --sign-with key.pem",
    ),
    "list": ("tumbleline certificate list", "tumbleline certificate list --at 2026-06-30 --json"),
    "revoke": (
        "tumbleline certificate revoke SN1 --reason 'fell to the floor'",
        "tumbleline certificate revoke SN1 2 --reason 'reference out of date'",
    ),
}
"""Of the subcommands."""


def list_certificates(
    serials: Annotated[list[str] | None, argument("[SERIAL]…", "The units; all by default.")] = None,
    at: Annotated[str, option("--at DATE", "Those alone that are valid on this day.")] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """List the certificates of the archive by unit: period of validity, state today or on --at, grade and run."""
    from pipelines.certificates import Ledger
    from pipelines.certificates.days import day_of, today
    from schemas.errors import WrongUse, did_you_mean

    store = Archive(archive)
    store.refuse_none()
    day = day_of(at, "--at") if at else ""
    every = sorted(Ledger(store).all(), key=lambda calibration: (calibration.serial, calibration.event.sequence))
    known = {calibration.serial for calibration in every}
    for serial in serials or ():
        if serial not in known:
            raise WrongUse(
                f"certificate list: unit '{serial}' has no certificate; {did_you_mean(serial, sorted(known))}"
            )
    listed = [
        calibration
        for calibration in every
        if (not serials or calibration.serial in serials) and (not day or calibration.holds(day))
    ]
    document = {
        "archive": str(store.root),
        "at": day or None,
        "certificates": [calibration.document() for calibration in listed],
    }

    def show(_: object) -> None:
        if not listed:
            say(f"no certificate{f' valid on {day}' if day else ''} in {store.root}")
            return
        rows = [
            [
                calibration.certificate,
                calibration.event.device,
                calibration.start,
                calibration.stated_until,
                calibration.event.grade,
                calibration.run,
                calibration.state_on(day or today()),
            ]
            for calibration in listed
        ]
        heads = ["certificate", "device", "from", "until", "grade", "run", f"state {day or 'today'}"]
        print_table(heads, rows, title=number_of(len(listed), "certificate"))

    give(document, show, as_json=as_json)


def write(
    names: Annotated[list[str], argument("RUN|UNIT…", "Runs, serial numbers or numbers of certificates (A1/2).")],
    laboratory: Annotated[
        Path, option("--laboratory FILE.toml", "TOML file with laboratory, customer, signatory and item.")
    ] = Path("laboratory.toml"),
    output: Annotated[Path, option("--output -o DIR", "Folder for the files; the current one.")] = Path(),
    sign_with: Annotated[
        str,
        option(
            "--sign-with KEY[,FILE]",
            "Sign PDF and XML: PKCS#12, or PEM with key and certificates; then a file with the password on its first line.",
        ),
    ] = "",
    address: Annotated[str, option("--address URL", "Print a QR code of this address; {number} is filled in.")] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Write, for every certified unit, SERIAL_N.pdf and SERIAL_N.xml with the content of ISO/IEC 17025, 7.8.2 and 7.8.4.

    A unit has to be certified before ('tumbleline certificate issue'): the number of its certificate is the one in the ledger.
    The same certificate gives the same bytes, unless it is signed. Exit status 1: some units of a run have no certificate.
    """
    from pipelines.certificates.document.issue import issue
    from pipelines.certificates.document.laboratory import read_laboratory
    from pipelines.certificates.document.signing import read_key

    refuse_standard_output(output, "certificate", "a folder for PDF and XML")
    who = read_laboratory(laboratory)
    file, _, password = sign_with.partition(",")
    key = read_key(Path(file), Path(password) if password else None) if sign_with else None
    done = issue(Archive(archive), names, who, output, key=key, address=address)
    lines = [f"certificate {entry.number}: {entry.pdf}, {entry.xml}" for entry in done.written]
    fields = ("serial", "run", "pdf", "xml", "signature")
    written = [{"certificate": entry.number, **{key: getattr(entry, key) for key in fields}} for entry in done.written]
    give({"certificates": written, "left_out": done.left_out}, lines, as_json=as_json)
    for serial, why in done.left_out.items():
        remark(f"certificate: {serial}: {why}")
    raise typer.Exit(PART_FAILED if done.left_out else DONE)


def revoke(
    serial: Annotated[str, argument("SERIAL", "The unit.")],
    certificate: Annotated[
        int, argument("[NUMBER]", "Number behind the serial, as in SN1/2; default: all that are valid today or later.")
    ] = 0,
    reason: ReasonOption = "",
    since: Annotated[
        str, option("--since DATE", "First day without validity; default: the first day of the calibration.")
    ] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Revoke a unit's calibration, with the reason. Nothing is deleted: the revocation is added to the ledger of the unit."""
    from pipelines.certificates import Ledger
    from pipelines.certificates.days import day_of
    from pipelines.certificates.ledger import left_valid
    from pipelines.report import renew_report

    store = Archive(archive)
    ledger = Ledger(store)
    event = ledger.revoke(serial, reason, day=day_of(since, "--since") if since else "", certificate=certificate)
    ended = [f"{serial}/{number}" for number in event.ends]
    for run in dict.fromkeys(
        calibration.run for calibration in ledger.calibrations(serial) if calibration.certificate in ended
    ):
        renew_report(Run(store, run))
    valid = left_valid(store, serial, event.ends)
    lines = [f"revoked {', '.join(ended)} from {event.start} on: {event.reason}"]
    for other in valid:
        words = (serial, other.removeprefix(f"{serial}/"), "--reason", event.reason, *archive_words(archive))
        command = command_line("certificate", "revoke", *words)
        lines += [f"{other}, of the same measurements, stays valid; this revokes it:", f"  {command}"]
    give({"unit": serial, "revoked": ended, "still_valid": valid, **event.document()}, lines, as_json=as_json)


app = group(SUMMARY, {"issue": issue, "list": list_certificates, "write": write, "revoke": revoke})
