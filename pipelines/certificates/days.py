"""Days of validity: ISO dates in UTC, compared as text. A range holds its first day and not its last."""

from __future__ import annotations

import calendar
from datetime import UTC, date, datetime

from schemas.errors import WrongUse

FIRST, LAST = "0001-01-01", "9999-12-31"


def day_of(text: str, where: str) -> str:
    """The UTC day that a date or an instant names.

    Parameters
    ----------
    text : ``2026-05-01``, or an instant such as ``2026-05-01T09:30:00+02:00``; one without an offset is UTC.
    where : names the option or key in a message.
    """
    try:
        moment = datetime.fromisoformat(text)
        utc = moment.astimezone(UTC) if moment.tzinfo else moment
    except (ValueError, OverflowError):  # a zone can lead out of the calendar
        raise WrongUse(f"{where}: found {text!r}, a date such as 2026-05-01 is needed; correct it") from None
    return utc.date().isoformat()


def today() -> str:
    """The day it is, UTC."""
    return datetime.now(UTC).date().isoformat()


def months_after(day: str, months: int) -> str:
    """The day so many months later; the last of a month where that has no such day."""
    start = date.fromisoformat(day)
    years, month = divmod(start.month - 1 + months, 12)
    year, month = start.year + years, month + 1
    if year > date.fromisoformat(LAST).year:
        return LAST
    return date(year, month, min(start.day, calendar.monthrange(year, month)[1])).isoformat()
