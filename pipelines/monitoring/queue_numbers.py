"""Numbers of the orchestrator, read over its HTTP interface: runs in the queues, late and recently crashed runs, workers."""

import json
import os
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any, cast

from pipelines.orchestrator.settings import CLIENT_KEY, KEY_FILE, use_key, with_key
from schemas.errors import LinkLost

ADDRESS = "PREFECT_API_URL"
TIMEOUT_S = 10.0
PAGE_SIZE = 200  # largest that the server allows
OPEN = ("SCHEDULED", "PENDING", "RUNNING", "PAUSED", "CANCELLING")
FAILED = ("CRASHED", "FAILED")
MISSED = ("missed:", "skipped:")  # beginnings of the messages of pipelines.orchestrator.queue_rules
LATE = timedelta(minutes=5)  # a run that has been due for longer is late; a worker requests work every ten seconds
RECENT = timedelta(days=1)


@dataclass(frozen=True)
class OpenRun:
    """A flow run; ``since`` is its start time, or the time at which it is due where it has not started."""

    id: str
    name: str
    queue: str
    state: str
    since: datetime
    message: str = ""
    count: int = 0


@dataclass
class QueueNumbers:
    """Numbers of the orchestrator.

    open : due, running and paused runs · ended : runs of the last day that crashed, failed, or were missed
    queues : names, and whether each is paused · workers : names, and whether each is online
    """

    open: list[OpenRun] = field(default_factory=list[OpenRun])
    ended: list[OpenRun] = field(default_factory=list[OpenRun])
    queues: dict[str, bool] = field(default_factory=dict[str, bool])
    workers: dict[str, bool] = field(default_factory=dict[str, bool])

    def late(self, now: datetime) -> list[OpenRun]:
        """Runs that have been due for more than five minutes while no other run of their queue is active."""
        busy = {run.queue for run in self.open if run.state in {"PENDING", "RUNNING", "PAUSED"}}
        due = [run for run in self.open if run.state == "SCHEDULED" and now - run.since > LATE]
        return [run for run in due if run.queue not in busy]


def configured() -> bool:
    """Whether PREFECT_API_URL names an orchestrator."""
    return bool(os.environ.get(ADDRESS))


def read_queues(now: datetime | None = None) -> QueueNumbers:
    """The numbers of the orchestrator that PREFECT_API_URL names.

    Raises LinkLost: it does not answer, or refuses the key.
    """
    at = now or datetime.now(UTC)
    if os.environ.get(KEY_FILE) or os.environ.get("CREDENTIALS_DIRECTORY"):
        use_key(CLIENT_KEY)
    due = {"state": {"type": {"any_": list(OPEN)}}, "expected_start_time": {"before_": at.isoformat()}}
    since = {"after_": (at - RECENT).isoformat()}
    failed = {"state": {"type": {"any_": list(FAILED)}}, "end_time": since}
    cancelled = {"state": {"type": {"any_": ["CANCELLED"]}}, "end_time": since}
    numbers = QueueNumbers(open=[_run(run) for run in _runs(due)])
    ended = [_run(run) for run in (*_runs(failed), *_runs(cancelled))]
    numbers.ended = [run for run in ended if run.state in FAILED or run.message.startswith(MISSED)]
    for pool in _ask("work_pools/filter", {"limit": PAGE_SIZE}):
        name = urllib.parse.quote(str(pool["name"]), safe="")
        for queue in _ask(f"work_pools/{name}/queues/filter", {"limit": PAGE_SIZE}):
            numbers.queues[queue["name"]] = bool(queue["is_paused"])
        for worker in _ask(f"work_pools/{name}/workers/filter", {"limit": PAGE_SIZE}):
            numbers.workers[worker["name"]] = worker["status"] == "ONLINE"
    return numbers


def _runs(criteria: dict[str, Any]) -> list[dict[str, Any]]:
    return _ask("flow_runs/filter", {"flow_runs": criteria, "sort": "EXPECTED_START_TIME_DESC", "limit": PAGE_SIZE})


def _run(content: dict[str, Any]) -> OpenRun:
    state = content.get("state") or {}
    since = content.get("start_time") or content.get("expected_start_time") or state.get("timestamp")
    return OpenRun(
        id=str(content["id"]),
        name=str(content["name"]),
        queue=str(content.get("work_queue_name") or ""),
        state=str(content["state_type"]),
        since=datetime.fromisoformat(str(since)),
        message=str(state.get("message") or ""),
        count=int(content.get("run_count") or 0),
    )


def _ask(path: str, content: dict[str, Any]) -> list[dict[str, Any]]:
    address = os.environ.get(ADDRESS, "").rstrip("/")
    request = urllib.request.Request(  # noqa: S310 - the address of the line's own server, from its configuration
        f"{address}/{path}", json.dumps(content).encode(), {"Content-Type": "application/json"}
    )
    try:
        with urllib.request.urlopen(with_key(request), timeout=TIMEOUT_S) as answer:  # noqa: S310
            return cast("list[dict[str, Any]]", json.load(answer))
    except (urllib.error.URLError, TimeoutError, ConnectionError, ValueError) as problem:
        if isinstance(problem, urllib.error.HTTPError):
            problem.close()
        fault = f"orchestrator: {address} does not answer ({problem}), a running server is needed"
        raise LinkLost(f"{fault}; start it, or correct {ADDRESS} and the key") from None
