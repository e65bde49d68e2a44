"""An event of a run: what happened at the station, why, and what was done about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Protocol

Kind = Literal["reference", "soak", "suspended", "resumed", "spoilt", "unit_lost", "power", "emergency_stop", "stopped"]

NO_RECORD = -1


@dataclass(frozen=True)
class Event:
    """One event at ``time_s`` on the station's clock; ``record`` is the one it befell, −1 where it befell none.

    ``figures`` are the numbers that belong to it, named with their unit.
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
    """Where the events of a capture are kept."""

    def note(self, event: Event) -> None:
        """Keep an event durably; one that is there already is not kept twice."""
        ...

    def noted(self) -> list[Event]:
        """Every event so far, in order."""
        ...


@dataclass
class MemoryLog:
    """Events in memory, for captures that are not resumed."""

    events: list[Event] = field(default_factory=list[Event])

    def note(self, event: Event) -> None:
        """Keep an event."""
        if event not in self.events:
            self.events.append(event)

    def noted(self) -> list[Event]:
        """Every event so far."""
        return list(self.events)
