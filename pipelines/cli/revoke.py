"""``tumbleline revoke``: end the validity of a unit's calibration, with the reason."""

from typing import Annotated

from pipelines.archive import Archive, Run
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import give

PART = "Certificates, trace, audit"
ORDER = 420
SUMMARY = "Revoke the calibration of a unit, with the reason."
EXAMPLES = (
    "tumbleline revoke SN1 --reason 'fell to the floor'",
    "tumbleline revoke SN1 --certificate 2 --reason 'reference out of date'",
)


def command(
    serial: Annotated[str, argument("SERIAL", "The unit.")],
    reason: Annotated[str, option("--reason", "Reason, for the users of the calibration.")] = "",
    day: Annotated[
        str, option("--from DATE", "First day without validity; default: the first day of the calibration.")
    ] = "",
    certificate: Annotated[
        int, option("--certificate", "Number after the serial; default: all that are valid today or later.", min=0)
    ] = 0,
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Revoke a unit's calibration, with the reason. Nothing is deleted: the revocation is added to the ledger of the unit."""
    from pipelines.certificates import Ledger
    from pipelines.certificates.days import day_of
    from pipelines.report import renew_report

    store = Archive(archive)
    ledger = Ledger(store)
    event = ledger.revoke(serial, reason, day=day_of(day, "--from") if day else "", certificate=certificate)
    ended = [f"{serial}/{number}" for number in event.ends]
    for run in dict.fromkeys(one.run for one in ledger.calibrations(serial) if one.certificate in ended):
        renew_report(Run(store, run))
    lines = [f"revoked {', '.join(ended)} from {event.start} on: {event.reason}"]
    give({"unit": serial, "revoked": ended, **event.document()}, lines, as_json=as_json)
