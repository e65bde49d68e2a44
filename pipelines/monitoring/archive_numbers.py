"""Numbers of an archive: runs, yield, interruptions, station time, lag of the chain, and units that are due."""

import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Self

from pipelines.archive import Archive, files
from pipelines.archive.listing import RunInfo
from pipelines.archive.run import SEALED
from pipelines.archive.store import Place
from pipelines.capture.interruptions import interruptions
from pipelines.certificates.days import today
from pipelines.certificates.ledger import Ledger
from schemas.errors import ArchiveUnusable, TumblelineError

DUE_DAYS = (0, 30)  # periods, days: a certificate is due where it ends within the period
IMPORTED = "(import)"  # station label of an imported run


@dataclass(frozen=True)
class RunTime:
    """Times of a finished run: on the station's clock, s; pauses and their duration, s; repeated dwells; door openings."""

    station_s: float = 0.0
    pauses: int = 0
    paused_s: float = 0.0
    repeated: int = 0
    door: int = 0

    def __add__(self, other: Self) -> Self:
        return type(self)(
            **{field.name: getattr(self, field.name) + getattr(other, field.name) for field in fields(self)}
        )


@dataclass
class LineNumbers:
    """Sums over the runs of one station and recipe inside the window; ``last`` is the newest start of a finished run."""

    finished: int = 0
    unfinished: int = 0
    passed: int = 0
    failed: int = 0
    last: datetime | None = None
    times: RunTime = RunTime()


@dataclass
class ArchiveNumbers:
    """Numbers of an archive.

    lag_s : time since the end of the oldest finished run that is not in the chain yet, s; 0 where all are
    free_bytes : free space on its disk; None for an object store
    due : number of units whose certificate ends within a period, by the period in days
    """

    lines: dict[tuple[str, str], LineNumbers] = field(default_factory=dict[tuple[str, str], LineNumbers])
    unsealed: int = 0
    lag_s: float = 0.0
    free_bytes: int | None = None
    certified: int = 0
    due: dict[int, int] = field(default_factory=dict[int, int])


class ArchiveReader:
    """Reads the numbers of an archive repeatedly; each finished run is read only once."""

    def __init__(self, archive: Archive, window_d: int) -> None:
        self.archive, self.window_d = archive, window_d
        self._times: dict[str, RunTime] = {}
        self._sealed: set[str] = set()

    def read(self, now: datetime | None = None) -> ArchiveNumbers:
        """The numbers of the runs that started within the window, and of all certificates."""
        self.archive.refuse_none()
        at = now or datetime.now(UTC)
        since = (at - timedelta(days=self.window_d)).isoformat()
        numbers = ArchiveNumbers()
        infos = [info for info in self.archive.runs() if info.started >= since and not info.rerun_of]
        for info in infos:
            key = (info.station or IMPORTED, info.recipe)
            self._add(numbers.lines.setdefault(key, LineNumbers()), info)
        self._lag([info for info in infos if info.finished], numbers, at)
        root = self.archive.root
        if isinstance(root, Path):
            numbers.free_bytes = shutil.disk_usage(root).free
        self._due(numbers)
        self._times = {info.id: self._times[info.id] for info in infos if info.id in self._times}
        return numbers

    def _add(self, line: LineNumbers, info: RunInfo) -> None:
        if not info.finished:
            line.unfinished += 1
            return
        line.finished += 1
        line.passed += info.passed or 0
        line.failed += (info.graded or 0) - (info.passed or 0)
        started = datetime.fromisoformat(info.started)
        line.last = started if line.last is None else max(line.last, started)
        if info.id not in self._times:
            self._times[info.id] = self._time_of(info.id)
        line.times += self._times[info.id]

    def _time_of(self, run_id: str) -> RunTime:
        run = self.archive.run(run_id)
        try:
            dwells = run.table("dwells") if "dwells" in run.tables() else None
            interrupted = interruptions(run)
        except TumblelineError:  # 'tumbleline verify' reports the faults of its files
            return RunTime()
        station_s = float(dwells["time_s"].max()) if dwells is not None and len(dwells) else 0.0
        if interrupted is None:
            return RunTime(station_s)
        repeated = sum(dwell["times"] for dwell in interrupted["repeated_dwells"])
        return RunTime(station_s, interrupted["pauses"], interrupted["paused_s"], repeated, interrupted["door_opened"])

    def _lag(self, finished: Iterable[RunInfo], numbers: ArchiveNumbers, at: datetime) -> None:
        for info in finished:
            path = self.archive.root / "runs" / info.id
            if info.id in self._sealed or (path / SEALED).is_file():
                self._sealed.add(info.id)
                continue
            numbers.unsealed += 1
            numbers.lag_s = max(numbers.lag_s, (at - _finished(path, info)).total_seconds())

    def _due(self, numbers: ArchiveNumbers) -> None:
        last: dict[str, str] = {}
        for calibration in Ledger(self.archive).all():
            last[calibration.serial] = max(last.get(calibration.serial, ""), calibration.until)
        numbers.certified = len(last)
        day = datetime.fromisoformat(today())  # by the calendar of certificates
        ends = {days: (day + timedelta(days=days)).date().isoformat() for days in DUE_DAYS}
        numbers.due = {days: sum(until <= end for until in last.values()) for days, end in ends.items()}


def _finished(path: Place, info: RunInfo) -> datetime:
    """When the report of a run, its last file before the seal, was written; its start where that cannot be read."""
    try:
        return datetime.fromisoformat(str(files.read_json(path / "report.json")["when"]))
    except (ArchiveUnusable, KeyError, ValueError):
        return datetime.fromisoformat(info.started)
