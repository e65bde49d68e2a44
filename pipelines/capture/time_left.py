"""Station time that is left of a capture: what was planned, corrected by what soaks and records have really taken."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pipelines.schedule.timing import schedule

if TYPE_CHECKING:
    from pipelines.capture.soak_response import Approach
    from pipelines.schedule.steps import Step
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
    _ramp: float | None = field(init=False, default=None)
    _lag: float | None = field(init=False, default=None)
    _since: tuple[int, float] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._planned(self.config)

    def _planned(self, config: StationConfig) -> None:
        """Plans soaks and records by a station's pace."""
        self._soak, self._record = {}, {}
        for stretch in schedule(self.plan, config, self.recipe):
            record = stretch.step.record
            kind = self._soak if stretch.kind == "soak" else self._record
            kind[record] = kind.get(record, 0.0) + stretch.seconds
        soaks = records = 0.0
        for step in reversed(self.plan):
            self._behind[step.record] = (soaks, records)
            soaks += self._soak.get(step.record, 0.0)
            records += self._record[step.record]

    @property
    def total(self) -> int:
        """Records in all."""
        return len(self.plan)

    def soaked(self, step: Step, seconds: float, approach: Approach | None) -> None:
        """Learns from a soak; one that only made sure of its temperature, without an ``approach``, teaches nothing."""
        if approach is not None and step.record in self._soak:
            self._learn(approach)
            self._soaks.add(self._soak[step.record], seconds)
        self._done.add(-1 - step.record)
        self._since = None

    def _learn(self, approach: Approach) -> None:
        """Plans anew with the ramp and the lag that a soak has shown, the first that showed them.

        A share that is right for one soak is wrong for the next, whose way is longer or shorter: ramp and lag are not.
        """
        known, ramp, lag = (self._ramp, self._lag), approach.air_ramp(), approach.lag_s()
        self._ramp, self._lag = self._ramp or ramp, self._lag or lag
        if (self._ramp, self._lag) == known:
            return
        config = self.config
        pace = config.pace.model_copy(
            update={"ramp_K_per_min": self._ramp or config.pace.ramp_K_per_min, "lag_s": self._lag or config.pace.lag_s}
        )
        changed: dict[str, object] = {"pace": pace}
        if config.simulation is not None and self._lag is not None:
            changed["simulation"] = config.simulation.model_copy(update={"slot_lag_s": (self._lag, self._lag)})
        self._planned(config.model_copy(update=changed))

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
        """The same for people; the time of a simulated station is not theirs."""
        whose = " of the station's time" if self.config.kind == "simulated" else ""
        return f"{duration_text(self.seconds(step, now))}{whose} left"


def duration_text(seconds: float) -> str:
    """A duration for people, in hours and minutes; seconds below two minutes."""
    if seconds < 2.0 * MINUTE_S:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / MINUTE_S), 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min"
