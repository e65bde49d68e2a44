"""All numbers at one time, and the verdict on them for health checks."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pipelines.archive import Archive
from pipelines.monitoring.archive_numbers import ArchiveNumbers, ArchiveReader
from pipelines.monitoring.documents import HealthDocument
from pipelines.monitoring.queue_numbers import QueueNumbers, configured, read_queues
from schemas.errors import TumblelineError
from stations.safety.folder import read_log, state_folder
from stations.safety.lease_files import read_holder

KEEP_S = 10.0  # time for which a snapshot is reused, s: several scrapers cause one reading
LAG_S = 3600.0
"""Longest time, s, between the start of a finished run and its entry in the hash chain; a killed writer leaves it out."""


@dataclass
class StationNumbers:
    """Numbers from the state folder.

    driven : stations with a live run · unsafe : stations without a live run and not reported safe, with the last run
    events : number of events in the log, by station and event
    """

    driven: set[str] = field(default_factory=set[str])
    unsafe: dict[str, str] = field(default_factory=dict[str, str])
    events: Counter[tuple[str, str]] = field(default_factory=Counter[tuple[str, str]])


def read_stations(folder: Path) -> StationNumbers:
    """The numbers of the stations whose leases are in a folder."""
    numbers = StationNumbers()
    for path in sorted((folder / "leases").glob("*.json")):
        holder = read_holder(path)
        if holder is None:
            continue
        if holder.lives(path) and holder.role == "run" and not holder.tripped:
            numbers.driven.add(holder.station)
        else:
            numbers.unsafe[holder.station] = f"{holder.run} (process {holder.pid} on {holder.host})"
    for line in read_log(folder):
        numbers.events[str(line.get("station", "")), str(line.get("event", ""))] += 1
    return numbers


@dataclass(frozen=True)
class Snapshot:
    """The numbers of each source; None where it could not be read or is not configured, with the reason in ``faults``."""

    when: datetime
    window_d: int
    archive: ArchiveNumbers | None
    queues: QueueNumbers | None
    stations: StationNumbers | None
    faults: dict[str, str] = field(default_factory=dict[str, str])
    least_free_bytes: float = 0.0
    expected: tuple[str, ...] = ()

    @property
    def problems(self) -> list[str]:
        """Problems that need a person; empty where the line is healthy."""
        out = [f"{source}: {fault}" for source, fault in self.faults.items() if fault]
        if self.archive is not None:
            out += self._of_archive(self.archive)
        if self.queues is not None:
            out += self._of_queues(self.queues)
        if self.stations is not None:
            out += [
                f"station {name}: not reported safe after {run}; check axes and chamber, see 'tumbleline station status'"
                for name, run in sorted(self.stations.unsafe.items())
            ]
        return out

    @property
    def ok(self) -> bool:
        """Whether the line is healthy."""
        return not self.problems

    def document(self) -> HealthDocument:
        """The verdict for JSON."""
        sources = {source: not fault for source, fault in self.faults.items()}
        when = self.when.isoformat(timespec="seconds")
        return {"ok": self.ok, "when": when, "problems": self.problems, "sources": sources}

    def _of_archive(self, numbers: ArchiveNumbers) -> list[str]:
        out: list[str] = []
        if numbers.free_bytes is not None and numbers.free_bytes < self.least_free_bytes:
            found, needed = numbers.free_bytes / 1e9, self.least_free_bytes / 1e9
            out.append(f"archive: {found:.1f} GB are free, at least {needed:g} GB are needed; free space on its disk")
        if numbers.lag_s > LAG_S:
            text = f"archive: {numbers.unsealed} finished runs are not in the hash chain, the oldest for"
            out.append(f"{text} {numbers.lag_s / 3600.0:.1f} h; run 'tumbleline archive clean'")
        return out

    def _of_queues(self, numbers: QueueNumbers) -> list[str]:
        online = {name.partition(" on ")[0] for name, is_online in numbers.workers.items() if is_online}
        late = [
            f"queue {run.queue}: run {run.name} was due at {run.since:%H:%M} UTC and has not started; start its worker, or "
            "resume its queue"
            for run in numbers.late(self.when)
        ]
        without_worker = [queue for queue in self.expected if queue not in online]
        needed = "no worker is online, one is needed; start tumbleline-worker@"
        return [*late, *(f"queue {queue}: {needed}{queue}" for queue in without_worker)]


def _reason(problem: Exception, prefix: str) -> str:
    """Why a source could not be read; never empty, as an empty reason means that it was read."""
    if isinstance(problem, TumblelineError | OSError) and str(problem):
        return str(problem).removeprefix(prefix)
    return f"{type(problem).__name__}: {problem}; run 'tumbleline verify', and report this message if it stays"


class Monitor:
    """Takes snapshots of an archive, the orchestrator of the environment and the stations of this computer.

    window_d : number of days whose runs are counted
    free_gb : free space that the archive needs, GB
    expected : queues that must have a worker online
    """

    def __init__(
        self, archive: Archive, window_d: int = 30, free_gb: float = 1.0, expected: Sequence[str] = ()
    ) -> None:
        self._reader = ArchiveReader(archive, window_d)
        self._free_bytes, self._expected = free_gb * 1e9, tuple(expected)
        self._lock = threading.Lock()
        self._last: tuple[float, Snapshot] | None = None

    def snapshot(self) -> Snapshot:
        """The numbers now, or those of the last ten seconds; a source that cannot be read is a fault, never an exception."""
        with self._lock:
            if self._last is not None and time.monotonic() - self._last[0] < KEEP_S:
                return self._last[1]
            snapshot = self._take()
            self._last = (time.monotonic(), snapshot)
            return snapshot

    def _take(self) -> Snapshot:
        sources: dict[str, Callable[[], Any]] = {
            "archive": self._reader.read,
            **({"orchestrator": read_queues} if configured() else {}),
            "stations": lambda: read_stations(state_folder()),
        }
        numbers, faults = dict[str, Any](), dict.fromkeys(sources, "")
        for source, read in sources.items():
            try:
                numbers[source] = read()
            except Exception as problem:  # noqa: BLE001 - a damaged file of one source must not hide the others
                faults[source] = _reason(problem, f"{source}: ")
        return Snapshot(
            datetime.now(UTC),
            self._reader.window_d,
            numbers.get("archive"),
            numbers.get("orchestrator"),
            numbers.get("stations"),
            faults,
            self._free_bytes,
            self._expected,
        )
