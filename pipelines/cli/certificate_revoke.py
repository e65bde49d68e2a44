"""``tumbleline certificate revoke``: end the validity of a unit's calibration, with the reason."""

from typing import Annotated

from pipelines.archive import Archive, Run
from pipelines.cli.next_commands import archive_words, command_line
from pipelines.cli.options import ArchiveOption, JsonOption, ReasonOption, argument, option
from pipelines.cli.printing import give


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
