"""The numbers in the text format of Prometheus."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from importlib.metadata import version

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily

from pipelines.monitoring.alerts import KINDS
from pipelines.monitoring.archive_numbers import ArchiveNumbers
from pipelines.monitoring.queue_numbers import QueueNumbers
from pipelines.monitoring.snapshot import Snapshot, StationNumbers

LINE = ("station", "recipe")
SHOWN_STATES = ("SCHEDULED", "PENDING", "RUNNING", "PAUSED")
TIMES = {
    "station_s": ("station_seconds", "Time on the clock of the station"),
    "pauses": ("pauses", "Pauses for a condition of the station"),
    "paused_s": ("paused_seconds", "Duration of the pauses"),
    "repeated": ("repeated_dwells", "Dwells that were discarded and measured again"),
    "door": ("door_openings", "Openings of the chamber door during runs"),
}
"""Name and meaning of each sum over runs, by its field of :class:`RunTime`."""


class _Collector:
    def __init__(self, snapshot: Snapshot) -> None:
        self._snapshot = snapshot

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """The families of all numbers, in the form of Prometheus."""
        snapshot = self._snapshot
        yield _family("info", "Version of Tumbleline", ("version",), {(version("tumbleline"),): 1.0})
        yield _family("healthy", "1 where /healthz answers 200", (), {(): snapshot.ok})
        read = {(source,): not fault for source, fault in snapshot.faults.items()}
        yield _family("source_up", "1 where the numbers of this source could be read", ("source",), read)
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
    yield _family("window_days", "Number of days whose runs are counted", (), {(): window_d})
    lines = sorted(numbers.lines.items())
    runs = {(*key, state): getattr(line, state) for key, line in lines for state in ("finished", "unfinished")}
    yield _family("runs", "Measurement runs", (*LINE, "state"), runs)
    units = {(*key, outcome): getattr(line, outcome) for key, line in lines for outcome in ("passed", "failed")}
    yield _family("units", "Graded units", (*LINE, "outcome"), units)
    share = {key: line.passed / graded for key, line in lines if (graded := line.passed + line.failed)}
    yield _family("yield_ratio", "Share of the graded units that passed", LINE, share)
    last = {key: line.last.timestamp() for key, line in lines if line.last is not None}
    yield _family("last_run_timestamp_seconds", "Start of the newest finished run", LINE, last)
    for count, (name, text) in TIMES.items():
        yield _family(name, text, LINE, {key: getattr(line.times, count) for key, line in lines})
    yield _family("archive_unsealed_runs", "Finished runs that are not in the hash chain", (), {(): numbers.unsealed})
    lag = "Age of the oldest finished run that is not in the hash chain"
    yield _family("archive_lag_seconds", lag, (), {(): numbers.lag_s})
    if numbers.free_bytes is not None:
        yield _family("archive_free_bytes", "Free space on the disk of the archive", (), {(): numbers.free_bytes})
    certified = "Units with at least one certificate, valid or not"
    yield _family("units_certified", certified, (), {(): numbers.certified})
    due = {(str(within),): count for within, count in numbers.due.items()}
    yield _family("units_due", "Units whose last certificate ends within the stated days", ("within_days",), due)


def _queues(numbers: QueueNumbers, now: datetime) -> Iterator[GaugeMetricFamily]:
    queues = sorted(numbers.queues)
    opened, ended = (Counter((run.queue, run.state) for run in runs) for runs in (numbers.open, numbers.ended))
    states = {(queue, state.lower()): opened[queue, state] for queue in queues for state in SHOWN_STATES}
    yield _family("queue_runs", "Flow runs that are due, running or paused", ("queue", "state"), states)
    since: dict[str, datetime] = {}
    for run in numbers.late(now):
        since[run.queue] = min(run.since, since.get(run.queue, run.since))
    late = {(queue,): (now - since.get(queue, now)).total_seconds() for queue in queues}
    yield _family("queue_late_seconds", "Time since the oldest late run of a free queue was due", ("queue",), late)
    paused = {(queue,): numbers.queues[queue] for queue in queues}
    yield _family("queue_paused", "1 where the queue is paused", ("queue",), paused)
    bad = {(queue, name): ended[queue, state] for queue in queues for state, name in KINDS.items()}
    text = "Flow runs of the last day that crashed, failed or were missed"
    yield _family("queue_ended_runs", text, ("queue", "state"), bad)
    online = {(worker,): is_online for worker, is_online in sorted(numbers.workers.items())}
    yield _family("worker_online", "1 where the worker has sent a heartbeat", ("worker",), online)


def _stations(numbers: StationNumbers) -> Iterator[GaugeMetricFamily]:
    names = sorted({*numbers.driven, *numbers.unsafe, *(station for station, _ in numbers.events)})
    driven, unsafe = ({(name,): name in known for name in names} for known in (numbers.driven, numbers.unsafe))
    yield _family("station_driven", "1 while a run drives the station", ("station",), driven)
    yield _family(
        "station_unsafe", "1 where the station was not reported safe after its last run", ("station",), unsafe
    )
    events = dict(sorted(numbers.events.items()))
    yield _family("station_events", "Events in the log of the state folder", ("station", "event"), events)


def _family(name: str, text: str, labels: Sequence[str], values: Mapping[tuple[str, ...], float]) -> GaugeMetricFamily:
    """A family of numbers, each by the values of the labels."""
    family = GaugeMetricFamily(f"tumbleline_{name}", text, labels=labels)
    for labelled, value in values.items():
        family.add_metric(labelled, float(value))
    return family
