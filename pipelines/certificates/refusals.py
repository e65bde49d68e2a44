"""What the ledger refuses, and why: a strange serial, an overdue standard, one serial on two units, nothing to revoke."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pipelines.certificates.days import today
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.certificates.entries import LedgerEntry
    from pipelines.certificates.validity import Calibration

START, END = "run.json", "readings.json"
SERIAL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,63}")


def refuse_serial(serial: str, where: str) -> None:
    """Refuse what cannot be printed on a device: line ends, separators of paths and the like."""
    if not SERIAL.fullmatch(serial):
        raise WrongUse(
            f"{where}: serial {serial!r}, one of letters, digits and . _ + - is needed (1 to 64, the first a letter or digit); "
            "correct the serial where it was entered"
        )


def refuse_other_device(known: Sequence[Calibration], event: LedgerEntry) -> None:
    """Refuse a serial that the ledger knows as another kind of device, unless those calibrations were revoked."""
    devices = {one.event.device for one in known if one.state != "revoked"} - {event.device}
    if devices:
        raise WrongUse(
            f"certify: unit {event.serial} of run {event.run} is a device {event.device}, the ledger knows this serial as "
            f"{', '.join(sorted(devices))}: two units have one serial; find out which is which, and give one another"
        )


def nothing_to_revoke(serial: str, known: Sequence[Calibration], certificate: int, day: str) -> str:
    """The message that there is no such calibration.

    Parameters
    ----------
    known : the unit's that hold on any day.
    certificate : sequence of the one that was meant; 0 for any.
    """
    if not known:
        return f"revoke: unit {serial!r} has no calibration that holds, one is needed; see 'tumbleline show' with --at"
    there = ", ".join(f"{one.certificate} ({one.start} to {one.until})" for one in known)
    what = (
        f"certificate {serial}/{certificate}"
        if certificate
        else f"a calibration of unit {serial} after {day or today()}"
    )
    return f"revoke: there is no {what} that still holds; there are {there}"
