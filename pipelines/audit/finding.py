"""A finding: one thing that somebody must do something about."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipelines.audit.calibrations import date_of

WHO = {  # in the order in which they are told
    "quality": "quality: certificates and units outside",
    "station": "whoever keeps the stations",
    "line": "the line: units to measure",
    "product": "engineering of the product",
    "archive": "whoever keeps the archive",
}
MORE = 20  # units named in a sentence's list


@dataclass(frozen=True)
class AuditFinding:
    """One thing to do.

    who : a key of :data:`WHO`; kind : of the finding, for machines; subject : what it is about
    units : serials concerned; evidence : the numbers behind it
    """

    who: str
    kind: str
    subject: str
    message: str
    units: tuple[str, ...] = ()
    evidence: dict[str, Any] = field(default_factory=dict[str, Any])


def date_or_never(day: float) -> str:
    """A date; ``never`` for what does not happen."""
    return date_of(day) if np.isfinite(day) else "never"


def some(units: tuple[str, ...]) -> str:
    """The first of many units, for a sentence."""
    named = ", ".join(units[:MORE])
    return f"{named}, …" if len(units) > MORE else named
