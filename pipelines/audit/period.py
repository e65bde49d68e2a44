"""What an audit looks at, from dates as texts."""

from __future__ import annotations

from pipelines.audit.audit import Scope
from pipelines.audit.calibrations import day_of
from pipelines.certificates.days import FIRST, today
from pipelines.certificates.days import day_of as checked
from schemas.errors import WrongUse


def scope_of(since: str, until: str, device: str, station: str) -> Scope:
    """What is looked at, from dates as texts; ``until`` holds its whole day."""
    first = day_of(checked(since or FIRST, "--since"))
    last = day_of(checked(until or today(), "--until")) + 1.0
    if first >= last:
        raise WrongUse(
            f"audit: --since {since} is after --until {until or today()}, a period is needed; exchange the two"
        )
    return Scope(first, last, device, station, day_of(today()) + 1.0)
