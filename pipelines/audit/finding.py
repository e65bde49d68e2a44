"""A finding: one fact that needs an action."""

from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from pipelines.audit.calibrations import date_of

WHO = {  # in the order of the report
    "quality": "quality: certificates and units outside",
    "station": "stations: maintenance",
    "line": "line: units to measure",
    "product": "product engineering",
    "archive": "archive: administration",
}
MORE = 20  # units listed in a sentence
Never = TypeVar("Never", str, None)


@dataclass(frozen=True)
class AuditFinding:
    """One finding with its action.

    who : a key of :data:`WHO`; kind : of the finding, for programs; subject : unit, station, device or run
    units : serials concerned; evidence : its numbers
    """

    who: str
    kind: str
    subject: str
    message: str
    units: tuple[str, ...] = ()
    evidence: dict[str, Any] = field(default_factory=dict[str, Any])


def date_or(day: float, never: Never) -> str | Never:
    """A date; ``never`` for infinity."""
    return date_of(day) if np.isfinite(day) else never


def date_or_never(day: float) -> str:
    """A date, or "never"."""
    return date_or(day, "never")


def some(units: tuple[str, ...]) -> str:
    """The first units of a list, for a sentence."""
    named = ", ".join(units[:MORE])
    return f"{named}, …" if len(units) > MORE else named
