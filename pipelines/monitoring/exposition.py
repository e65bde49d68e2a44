"""The numbers in the text format of Prometheus."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from importlib.metadata import version

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily

from pipelines.monitoring.archive_numbers import ArchiveNumbers
from pipelines.monitoring.queue_numbers import QueueNumbers
from pipelines.monitoring.snapshot import Snapshot
from pipelines.monitoring.station_numbers import StationNumbers

LINE = ("station", "recipe")


class _Collector:
    """Collector for the Prometheus client library."""

    def __init__(self, snapshot: Snapshot) -> None:
        self._snapshot = snapshot

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """All families."""
        snapshot = self._snapshot
        yield _one("info", "Version of Tumbleline", 1.0, ("version",), (version("tumbleline"),))
        yield _one("healthy", "1 where /healthz answers 200", float(snapshot.ok))
        up = _family("source_up", "1 where the numbers of this source could be read", ("source",))
        for source, fault in snapshot.faults.items():
            up.add_metric([source], float(not fault))
        yield up
        if snapshot.archive is not None:
            yield from _archive(snapshot.archive, snapshot.window_d)
        if snapshot.queues is not None:
            yield from _queues(snapshot.queues, snapshot.when)
        if snapshot.stations is not None:
            yield from _stations(snapshot.stations)


def text(snapshot: Snapshot) -> bytes:
    """The numbers as UTF-8 text, version 0.0.4 of the format."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Collector(snapshot))
    return generate_latest(registry)


def _archive(numbers: ArchiveNumbers, window_d: int) -> Iterator[GaugeMetricFamily]:
    yield _one("window_days", "Number of days whose runs are counted", float(window_d))
    runs = _family("runs", "Measurement runs", (*LINE, "state"))
    units = _family("units", "Graded units", (*LINE, "outcome"))
    share = _family("yield_ratio", "Share of the graded units that passed", LINE)
    last = _family("last_run_timestamp_seconds", "Start of the newest finished run", LINE)
    sums = {
        "station_s": _family("station_seconds", "Time on the clock of the station", LINE),
        "pauses": _family("pauses", "Pauses for a condition of the station", LINE),
        "paused_s": _family("paused_seconds", "Duration of the pauses", LINE),
        "repeated": _family("repeated_dwells", "Dwells that were discarded and measured again", LINE),
        "door": _family("door_openings", "Openings of the chamber door during runs", LINE),
    }
    for key, line in sorted(numbers.lines.items()):
        runs.add_metric([*key, "finished"], line.finished)
        runs.add_metric([*key, "unfinished"], line.unfinished)
        units.add_metric([*key, "passed"], line.passed)
        units.add_metric([*key, "failed"], line.failed)
        if line.passed + line.failed:
            share.add_metric(key, line.passed / (line.passed + line.failed))
        if line.last is not None:
            last.add_metric(key, line.last.timestamp())
        for name, family in sums.items():
            family.add_metric(key, float(getattr(line, name)))
    yield from (runs, units, share, last, *sums.values())
    yield _one("archive_unsealed_runs", "Finished runs that are not in the hash chain", float(numbers.unsealed))
    yield _one("archive_lag_seconds", "Age of the oldest finished run that is not in the hash chain", numbers.lag_s)
    if numbers.free_bytes is not None:
        yield _one("archive_free_bytes", "Free space on the disk of the archive", float(numbers.free_bytes))
    yield _one("units_certified", "Units with at least one certificate, valid or not", float(numbers.certified))
    due = _family("units_due", "Units whose last certificate ends within the stated days", ("within_days",))
    for within, count in numbers.due.items():
        due.add_metric([str(within)], count)
    yield due


def _queues(numbers: QueueNumbers, now: datetime) -> Iterator[GaugeMetricFamily]:
    runs = _family("queue_runs", "Flow runs that are due, running or paused", ("queue", "state"))
    late = _family("queue_late_seconds", "Time since the oldest late run of a free queue was due", ("queue",))
    paused = _family("queue_paused", "1 where the queue is paused", ("queue",))
    ended = _family(
        "queue_ended_runs", "Flow runs of the last day that crashed, failed or were missed", ("queue", "state")
    )
    online = _family("worker_online", "1 where the worker has sent a heartbeat", ("worker",))
    late_runs = numbers.late(now)
    for queue, is_paused in sorted(numbers.queues.items()):
        own = [run.state for run in numbers.open if run.queue == queue]
        for state in ("SCHEDULED", "PENDING", "RUNNING", "PAUSED"):
            runs.add_metric([queue, state.lower()], own.count(state))
        since = [run.since for run in late_runs if run.queue == queue]
        late.add_metric([queue], (now - min(since)).total_seconds() if since else 0.0)
        paused.add_metric([queue], float(is_paused))
        bad = [run.state for run in numbers.ended if run.queue == queue]
        for state in ("CRASHED", "FAILED", "CANCELLED"):
            ended.add_metric([queue, "missed" if state == "CANCELLED" else state.lower()], bad.count(state))
    for worker, is_online in sorted(numbers.workers.items()):
        online.add_metric([worker], float(is_online))
    yield from (runs, late, paused, ended, online)


def _stations(numbers: StationNumbers) -> Iterator[GaugeMetricFamily]:
    driven = _family("station_driven", "1 while a run drives the station", ("station",))
    unsafe = _family("station_unsafe", "1 where the station was not reported safe after its last run", ("station",))
    events = _family("station_events", "Events in the log of the state folder", ("station", "event"))
    for name in sorted({*numbers.driven, *numbers.unsafe, *(station for station, _ in numbers.events)}):
        driven.add_metric([name], float(name in numbers.driven))
        unsafe.add_metric([name], float(name in numbers.unsafe))
    for (station, event), count in sorted(numbers.events.items()):
        events.add_metric([station, event], count)
    yield from (driven, unsafe, events)


def _family(name: str, text: str, labels: Sequence[str]) -> GaugeMetricFamily:
    return GaugeMetricFamily(f"tumbleline_{name}", text, labels=labels)


def _one(
    name: str, text: str, value: float, labels: Sequence[str] = (), values: Sequence[str] = ()
) -> GaugeMetricFamily:
    family = _family(name, text, labels)
    family.add_metric(values, value)
    return family
