"""Remaining station time of a capture: planned times, corrected by measured times and by the measured response of soaks."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from inertial.arrays import Array
from pipelines.schedule.steps import Step
from pipelines.schedule.timing import schedule
from schemas.recipe import Recipe
from schemas.station import StationConfig

LAG_STEP_K = 1.5  # smallest temperature step that identifies a lag
RAMP_STEP_K = 5.0  # smallest temperature step that identifies the ramp
FEWEST_ROWS = 12
QUIET_K = 0.3  # smaller differences between air and device are due to place and noise


@dataclass
class Approach:
    """Temperatures of air and devices on the way to a soak's target, °C."""

    target: float
    rows: list[tuple[float, float, list[float]]] = field(default_factory=list["tuple[float, float, list[float]]"])

    def add(self, time: float, air: float, devices: Sequence[float]) -> None:
        """Adds the temperatures of one instant, s and °C."""
        self.rows.append((time, air, list(devices)))

    def figures(self) -> dict[str, float]:
        """Overshoot of air and devices for the journal, K."""
        columns = zip(*((air, *devices) for _, air, devices in self.rows), strict=True)
        air, *devices = [round(self._beyond(column), 4) for column in columns] or [0.0]
        return {"air_overshoot_K": air, "device_overshoot_K": max(devices, default=0.0)}

    def _beyond(self, values: Sequence[float]) -> float:
        """Overshoot of values over the target, from their first value on, K; values that are not finite are left out."""
        known = [value for value in values if math.isfinite(value)]
        if not known:
            return 0.0
        direction = math.copysign(1.0, self.target - known[0])
        return max(0.0, *(direction * (value - self.target) for value in known))

    def air_ramp(self) -> float | None:
        """Ramp of the air between 10 % and 80 % of the step, K/min; None where the step was too small."""
        air = self._air()
        if len(air) < FEWEST_ROWS or abs(self.target - air[0, 1]) < RAMP_STEP_K:
            return None
        part = (air[:, 1] - air[0, 1]) / (self.target - air[0, 1])
        begin, end = int(np.argmax(part >= 0.1)), int(np.argmax(part >= 0.8))
        if end <= begin:
            return None
        return float(abs(air[end, 1] - air[begin, 1]) / (air[end, 0] - air[begin, 0]) * 60.0)

    def lag_s(self) -> float | None:
        """Lag of the slowest device behind the air, s; None where the step was too small.

        First order: the slope of a device is its difference to the air at its place, over its lag. A straight line through slopes
        against differences gives both.
        """
        air = self._air()
        if len(air) < FEWEST_ROWS or abs(self.target - air[0, 1]) < LAG_STEP_K:
            return None
        devices = np.array([row[2] for row in self.rows if math.isfinite(row[1])], dtype=np.float64)
        lags = [lag for column in devices.T if (lag := _lag(air, column)) is not None]
        return max(lags, default=None)

    def _air(self) -> Array:
        """Time and temperature of the air, (n, 2)."""
        rows = [(time, air) for time, air, _ in self.rows if math.isfinite(air)]
        return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _lag(air: Array, device: Array) -> float | None:
    """Lag of one device, s, from air (n, 2) in s and °C and the device (n,) in °C."""
    step = np.diff(air[:, 0])
    distance = air[:, 1] - device
    between = (distance[1:] + distance[:-1]) / 2.0
    used = (step > 0.0) & np.isfinite(between) & (np.abs(between) > QUIET_K)
    if used.sum() < FEWEST_ROWS // 2:
        return None
    slope = np.diff(device)[used] / step[used]
    design = np.stack((between[used], np.ones(int(used.sum()))), axis=1)
    rate = float(np.linalg.lstsq(design, slope, rcond=None)[0][0])
    return 1.0 / rate if rate > 0.0 else None


MOST = 4.0  # bound of the correction: a soak or record that took longer was disturbed, which says nothing of the next
HOUR_S, MINUTE_S = 3600.0, 60.0


@dataclass
class _Pace:
    """Planned and measured seconds of one kind of work so far."""

    planned: float = 0.0
    measured: float = 0.0

    def add(self, planned: float, measured: float) -> None:
        self.planned += planned
        self.measured += measured

    @property
    def factor(self) -> float:
        """Measured over planned time."""
        return min(MOST, max(1.0 / MOST, self.measured / self.planned)) if self.planned > 0.0 else 1.0


class Remaining:
    """Seconds of station time that the remaining steps of a capture need."""

    def __init__(self, plan: list[Step], config: StationConfig, recipe: Recipe) -> None:
        self.plan, self.config, self.recipe = plan, config, recipe
        self._done: set[int] = set()
        self._soaks, self._records = _Pace(), _Pace()
        self._ramp: float | None = None
        self._lag: float | None = None
        self._since: tuple[int, float] | None = None
        self._started = time.monotonic()
        self._planned(config)

    def _planned(self, config: StationConfig) -> None:
        """Sums the planned seconds of soaks and records, by record and of all later records."""
        self._soak: dict[int, float] = {}
        self._record: dict[int, float] = {}
        self._after: dict[int, tuple[float, float]] = {}
        for activity in schedule(self.plan, config, self.recipe):
            record = activity.step.record
            kind = self._soak if activity.kind == "soak" else self._record
            kind[record] = kind.get(record, 0.0) + activity.seconds
        soaks = records = 0.0
        for step in reversed(self.plan):
            self._after[step.record] = (soaks, records)
            soaks += self._soak.get(step.record, 0.0)
            records += self._record[step.record]

    def leave_out(self, records: set[int]) -> None:
        """Goes on without some records."""
        self.plan = [step for step in self.plan if step.record not in records]
        self._planned(self.config)

    @property
    def total(self) -> int:
        """Records in all."""
        return len(self.plan)

    def add_soak(self, step: Step, seconds: float, approach: Approach | None) -> None:
        """Adds the measured seconds of a soak; without ``approach`` it only confirmed its temperature and is not counted."""
        if approach is not None and step.record in self._soak:
            self._learn(approach)
            self._soaks.add(self._soak[step.record], seconds)
        self._done.add(-1 - step.record)
        self._since = None

    def _learn(self, approach: Approach) -> None:
        """Plans again with the first ramp and the first lag that a soak has shown.

        A factor from one soak is wrong for the next, whose temperature step differs; ramp and lag hold for both.
        """
        known = self._ramp, self._lag
        self._ramp, self._lag = self._ramp or approach.air_ramp(), self._lag or approach.lag_s()
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

    def add_record(self, step: Step, seconds: float) -> None:
        """Adds the measured seconds of a record."""
        self._records.add(self._record[step.record], seconds)
        self._done.add(step.record)
        self._since = None

    def seconds(self, step: Step, now: float) -> float:
        """Station time until the end of the capture, s, while ``step`` is under way at ``now`` s."""
        key = step.record if -1 - step.record in self._done or step.record not in self._soak else -1 - step.record
        if self._since is None or self._since[0] != key:
            self._since = (key, now)
        under_way = (
            self._soaks.factor * self._soak[step.record] if key < 0 else self._records.factor * self._record[key]
        )
        soaks, records = self._after[step.record]
        records += self._record[step.record] if key < 0 else 0.0
        left = self._soaks.factor * soaks + self._records.factor * records
        return left + max(0.0, under_way - (now - self._since[1]))

    def text(self, step: Step, now: float) -> str:
        """The remaining time in words; of a simulated station the time of the station, and that of the wall clock."""
        station = duration_text(self.seconds(step, now))
        if self.config.kind != "simulated":
            return f"{station} left"
        wall = self.wall_seconds(step)
        return f"{station} of station time left" + ("" if wall is None else f", about {duration_text(wall)} here")

    def wall_seconds(self, step: Step) -> float | None:
        """Time until the end of the capture by the wall clock, s; None before the first record.

        A simulated station skips the soaks: its time goes by with the samples, which records have in proportion to their length.
        """
        if self._records.planned <= 0.0:
            return None
        left = self._after[step.record][1] + (0.0 if step.record in self._done else self._record[step.record])
        return (time.monotonic() - self._started) * left / self._records.planned


def duration_text(seconds: float) -> str:
    """A duration in hours and minutes; in seconds below two minutes."""
    if seconds < 2.0 * MINUTE_S:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / MINUTE_S), 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min"
