"""Days of validity: ISO dates in UTC, compared as text. A range includes its first day and not its last."""

import calendar
from datetime import UTC, date, datetime

from schemas.errors import WrongUse

FIRST, LAST = "0001-01-01", "9999-12-31"


def day_of(text: str, where: str) -> str:
    """The UTC day of a date or an instant.

    Parameters
    ----------
    text : ``2026-05-01``, or an instant such as ``2026-05-01T09:30:00+02:00``; without an offset it is UTC.
    where : names the option or key in a message.
    """
    try:
        moment = datetime.fromisoformat(text)
        utc = moment.astimezone(UTC) if moment.tzinfo else moment
    except (ValueError, OverflowError):  # with its zone an instant can lie outside the calendar
        raise WrongUse(f"{where}: found {text!r}, a date such as 2026-05-01 is needed; correct it") from None
    return utc.date().isoformat()


def today() -> str:
    """The present day, UTC."""
    return datetime.now(UTC).date().isoformat()


def months_after(day: str, months: int) -> str:
    """The day ``months`` later; the last day of that month if it has no such day."""
    start = date.fromisoformat(day)
    years, month = divmod(start.month - 1 + months, 12)
    year, month = start.year + years, month + 1
    if year > date.fromisoformat(LAST).year:
        return LAST
    return date(year, month, min(start.day, calendar.monthrange(year, month)[1])).isoformat()
