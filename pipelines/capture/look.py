"""The evaluation of the records of a capture while it goes on, and its entry in the journal."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from schemas.event import Event

DWELL_S = "dwell_s"


@dataclass(frozen=True)
class Look:
    """The evaluation of the records so far.

    known : whether every unit is decided; text : why, or what is missing
    fails : units not reported before, with the figure that they fail; given_up : effects that the end leaves unseen
    dwell_s : length of the dwells from here on; None where it stays
    """

    known: bool
    text: str
    fails: dict[str, str] = field(default_factory=dict[str, str])
    given_up: tuple[str, ...] = ()
    dwell_s: float | None = None


class Looks(Protocol):
    """Decides during a capture whether further records are needed."""

    def due(self, record: int) -> bool:
        """Whether the records so far are evaluated after this record."""
        ...

    def look(self, record: int, reported: frozenset[str]) -> Look:
        """The evaluation of the records up to this record; ``reported``: units whose failure is known already."""
        ...


def recorded_look(events: Sequence[Event], record: int) -> Look | None:
    """The look after a record that the journal has; None where it was not taken."""
    for event in events:
        if event.kind in ("look", "known") and event.record == record:
            return Look(event.kind == "known", event.reason, dwell_s=event.figures.get(DWELL_S))
    return None
