"""Refusals of the ledger with their reasons, such as an invalid serial, an overdue standard, or dates that are not allowed."""

import re
from collections.abc import Sequence

from pipelines.archive import Run
from pipelines.certificates.days import months_after, today
from pipelines.certificates.entries import LedgerEntry
from pipelines.certificates.measured import measured_on
from pipelines.certificates.validity import Calibration
from schemas.errors import WrongUse

NOT_STATED = "imported"
"""Device of the units of an import."""
SERIAL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,63}")


def refuse_period(run: Run, first: str, last: str) -> None:
    """Refuse a certificate that begins before the run's measurement was over, or too long after it, or lasts too long.

    Parameters
    ----------
    first, last : first day, and the day after the last.
    """
    measured, months = measured_on(run), allowed_months(run)
    limits = str((run.about.get("limits") or {}).get("name", ""))
    if first < measured:
        raise WrongUse(
            f"certify: valid from {first}, run {run.id} was measured on {measured}, that day or a later one is needed; correct "
            "--since"
        )
    rule = (
        f"limits '{limits}' allow {months} months; state validity_months in a limits file before the units are graded"
    )
    if last > months_after(first, months):
        raise WrongUse(
            f"certify: valid from {first} until {last}, no more than until {months_after(first, months)} is allowed; {rule}"
        )
    if first >= months_after(measured, months):
        raise WrongUse(
            f"certify: valid from {first}, run {run.id} was measured on {measured} and can be certified until "
            f"{months_after(measured, months)}; measure the units again ({rule})"
        )


def allowed_months(run: Run) -> int:
    """Longest that a certificate of a run may hold, months: by its limits, else by policy."""
    from schemas.limits import (
        MOST_MONTHS,
        VALIDITY_MONTHS,
    )  # slow to import, and who only reads the ledger does without

    stated = (run.about.get("limits") or {}).get("validity_months")
    allowed = stated if type(stated) is int and 1 <= stated <= MOST_MONTHS else VALIDITY_MONTHS
    figures = ((run.about.get("recipe") or {}).get("certificate") or {}).get("validity_months")
    return min(allowed, figures) if type(figures) is int and figures >= 1 else allowed


def refuse_serial(serial: str, where: str) -> None:
    """Refuse what cannot be printed on a device: line ends, separators of paths and the like."""
    if not SERIAL.fullmatch(serial):
        raise WrongUse(
            f"{where}: serial {serial!r}, one of letters, digits and . _ + - is needed (1 to 64, the first a letter or digit); "
            "correct the serial where it was entered"
        )


def refuse_other_device(known: Sequence[Calibration], event: LedgerEntry) -> None:
    """Refuse a serial that the ledger knows as another kind of device, unless those calibrations were revoked.

    The device of an import is not stated, and contradicts none.
    """
    standing = (calibration.event.device for calibration in known if calibration.state != "revoked")
    devices = set(standing) - {event.device, NOT_STATED}
    if devices and event.device != NOT_STATED:
        raise WrongUse(
            f"certify: unit {event.serial} of run {event.run} is a device {event.device}, the ledger knows this serial as "
            f"{', '.join(sorted(devices))}: two units have one serial; find out which is which, and give one another"
        )


def nothing_to_revoke(serial: str, known: Sequence[Calibration], certificate: int, day: str, hint: str = "") -> str:
    """The message that there is no such calibration.

    Parameters
    ----------
    known : the unit's that hold on any day.
    certificate : sequence of the certificate that was meant; 0 for any.
    hint : what may have been meant instead.
    """
    if not known:
        hint = hint or "see 'tumbleline show' with --at"
        return f"revoke: unit {serial!r} has no calibration that holds, one is needed; {hint}"
    listed = ", ".join(
        f"{calibration.certificate} ({calibration.start} to {calibration.until})" for calibration in known
    )
    what = (
        f"certificate {serial}/{certificate}"
        if certificate
        else f"a calibration of unit {serial} after {day or today()}"
    )
    return f"revoke: there is no {what} that still holds; there are {listed}"
