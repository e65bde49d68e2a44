"""An event of a run: kind, reason and action."""

from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Protocol

Kind = Literal[
    "reference",
    "soak",
    "suspended",
    "resumed",
    "spoilt",
    "unit_lost",
    "power",
    "emergency_stop",
    "stopped",
    "look",
    "fails",
    "known",
    "given_up",
]

NO_RECORD = -1


@dataclass(frozen=True)
class Event:
    """One event at ``time_s`` on the clock of the station; ``record`` is the affected record, −1 for none.

    ``figures`` are its numerical values, named with their unit.
    """

    time_s: float
    kind: Kind
    record: int
    reason: str
    action: str
    figures: dict[str, float] = field(default_factory=dict[str, float])

    def document(self) -> dict[str, Any]:
        """The event for JSON."""
        return asdict(self)


class EventLog(Protocol):
    """The log of the events of a capture."""

    def note(self, event: Event) -> None:
        """Write an event durably; an event in the log is not written twice."""

    def recorded(self) -> list[Event]:
        """Every event so far, in order."""
        ...


@dataclass
class MemoryLog:
    """Events in memory, for captures that are not resumed."""

    events: list[Event] = field(default_factory=list[Event])

    def note(self, event: Event) -> None:
        """Append an event that is not in the log."""
        if event not in self.events:
            self.events.append(event)

    def recorded(self) -> list[Event]:
        """Every event so far."""
        return list(self.events)
