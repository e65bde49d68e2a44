"""``tumbleline certificate list``: every certificate of the archive with its period and its state."""

from typing import Annotated

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import give, print_table, say


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
