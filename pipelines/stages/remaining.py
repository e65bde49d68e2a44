"""Station time that is left of a capture: what was planned, corrected by what soaks and records have really taken."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pipelines.stages.minutes import itinerary

if TYPE_CHECKING:
    from pipelines.stages.capture import Step
    from schemas.recipe import Recipe
    from schemas.station import StationConfig

MOST = 4.0  # a soak or record that took so much longer than planned was disturbed; the next need not be
HOUR_S, MINUTE_S = 3600.0, 60.0


@dataclass
class _Pace:
    """What was planned of one kind of work so far, and what it took."""

    planned: float = 0.0
    took: float = 0.0

    def add(self, planned: float, took: float) -> None:
        self.planned += planned
        self.took += took

    @property
    def factor(self) -> float:
        """By how much the work takes longer than planned."""
        return min(MOST, max(1.0 / MOST, self.took / self.planned)) if self.planned > 0.0 else 1.0


@dataclass
class Remaining:
    """Seconds of station time that a capture's steps still need."""

    plan: list[Step]
    config: StationConfig
    recipe: Recipe
    _soak: dict[int, float] = field(init=False, default_factory=dict[int, float])
    _record: dict[int, float] = field(init=False, default_factory=dict[int, float])
    _behind: dict[int, tuple[float, float]] = field(init=False, default_factory=dict[int, "tuple[float, float]"])
    _done: set[int] = field(init=False, default_factory=set[int])
    _soaks: _Pace = field(init=False, default_factory=_Pace)
    _records: _Pace = field(init=False, default_factory=_Pace)
    _since: tuple[int, float] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        for stretch in itinerary(self.plan, self.config, self.recipe):
            if stretch.kind == "soak":
                self._soak[stretch.step.record] = stretch.seconds
            else:
                record = stretch.step.record
                self._record[record] = self._record.get(record, 0.0) + stretch.seconds
        soaks = records = 0.0
        for step in reversed(self.plan):
            self._behind[step.record] = (soaks, records)
            soaks += self._soak.get(step.record, 0.0)
            records += self._record[step.record]

    @property
    def total(self) -> int:
        """Records in all."""
        return len(self.plan)

    def soaked(self, step: Step, seconds: float, *, whole: bool) -> None:
        """Learns from a soak; one that only made sure of its temperature teaches nothing."""
        planned = self._soak.get(step.record, 0.0)
        if whole and planned > 0.0:
            self._soaks.add(planned, seconds)
        self._done.add(-1 - step.record)
        self._since = None

    def taken(self, step: Step, seconds: float) -> None:
        """Learns from a record."""
        self._records.add(self._record[step.record], seconds)
        self._done.add(step.record)
        self._since = None

    def seconds(self, step: Step, now: float) -> float:
        """Station time until the end of the capture, asked while ``step`` is under way at ``now`` s."""
        key = step.record if -1 - step.record in self._done or step.record not in self._soak else -1 - step.record
        if self._since is None or self._since[0] != key:
            self._since = (key, now)
        under_way = (
            self._soaks.factor * self._soak[step.record] if key < 0 else self._records.factor * self._record[key]
        )
        soaks, records = self._behind[step.record]
        records += self._record[step.record] if key < 0 else 0.0
        left = self._soaks.factor * soaks + self._records.factor * records
        return left + max(0.0, under_way - (now - self._since[1]))

    def text(self, step: Step, now: float) -> str:
        """The same for people."""
        return f"{duration_text(self.seconds(step, now))} left"


def duration_text(seconds: float) -> str:
    """A duration for people, in hours and minutes; seconds below two minutes."""
    if seconds < 2.0 * MINUTE_S:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / MINUTE_S), 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min"
