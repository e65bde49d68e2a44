"""The person beside the device, and what a bring-up finds."""

from dataclasses import dataclass, field
from typing import Literal, Protocol

Verdict = Literal["held", "differs", "not tried"]
Part = Literal["reach", "register", "panel", "order", "link"]


class Person(Protocol):
    """Who reads the device's panel and allows each step."""

    def tell(self, text: str) -> None:
        """Shows a line."""

    def ask(self, question: str) -> str:
        """The typed answer; empty for a skipped question, and where nobody types."""
        ...


@dataclass(frozen=True)
class Point:
    """One line of a conformance page: a register, or a promise of the device's family."""

    part: Part
    what: str
    verdict: Verdict
    found: str = ""
    expected: str = ""
    remedy: str = ""


def judged(*, good: bool) -> Verdict:
    """Whether something held or differs."""
    return "held" if good else "differs"


@dataclass
class Findings:
    """The points so far, and the changes to the profile that they ask for."""

    points: list[Point] = field(default_factory=list[Point])
    changes: dict[str, dict[str, object]] = field(default_factory=dict[str, dict[str, object]])

    def add(
        self, part: Part, what: str, verdict: Verdict, found: str = "", expected: str = "", remedy: str = ""
    ) -> None:
        """Add a point; a point that held needs no remedy."""
        self.points.append(Point(part, what, verdict, found, expected, "" if verdict == "held" else remedy))

    def change(self, register: str, key: str, value: object) -> None:
        """A corrected key of a register of the profile; of the profile itself where ``register`` is empty."""
        self.changes.setdefault(register, {})[key] = value

    def count(self, verdict: Verdict) -> int:
        """Number of points with this verdict."""
        return sum(point.verdict == verdict for point in self.points)
