"""What a look at the records of a capture says, and what the journal keeps of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from schemas.event import Event

DWELL_S = "dwell_s"


@dataclass(frozen=True)
class Look:
    """What the records so far say.

    known : whether every unit is decided; text : why, or what is missing
    fails : units that have not been told before, with the figure that they fail; given_up : effects that the end leaves unseen
    dwell_s : length of the dwells from here on; None where it stays
    """

    known: bool
    text: str
    fails: dict[str, str] = field(default_factory=dict[str, str])
    given_up: tuple[str, ...] = ()
    dwell_s: float | None = None


class Looks(Protocol):
    """What decides during a capture."""

    def due(self, record: int) -> bool:
        """Whether the records are looked at after this one."""
        ...

    def look(self, record: int, told: frozenset[str]) -> Look:
        """What the records up to this one say; ``told``: units that fail already."""
        ...


def recorded_look(events: Sequence[Event], record: int) -> Look | None:
    """The look after a record that the journal has; None where it was not taken."""
    for event in events:
        if event.kind in ("look", "known") and event.record == record:
            return Look(event.kind == "known", event.reason, dwell_s=event.figures.get(DWELL_S))
    return None
