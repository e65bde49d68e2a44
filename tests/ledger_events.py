"""Events of calibrations, for tests that need a ledger without a run."""

from dataclasses import replace
from datetime import UTC, date, datetime, timedelta

from pipelines.certificates import LedgerEntry


def day(number: int = 0) -> str:
    """The day so many days from today, UTC: what is measured in a test cannot be certified for days before."""
    return (datetime.now(UTC).date() + timedelta(days=number)).isoformat()


def day_before(text: str) -> str:
    """The day before one, where a suite runs over midnight."""
    return (date.fromisoformat(text) - timedelta(days=1)).isoformat()


def event(serial: str = "A1", start: str = "2026-01-01", until: str = "2027-01-01", **more: object) -> LedgerEntry:
    blank = LedgerEntry(
        serial=serial, sequence=0, action="certify", device="ADXL355", run="r-1", start=start, until=until, grade="tactical",
        station="bench", recipe="small", coefficients="c", ends=(), who="", where="", when="", reason="", previous="",
    )  # fmt: skip
    return replace(blank, **more)
