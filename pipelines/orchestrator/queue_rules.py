"""Rules for the runs in a station's queue: missed and skipped runs are cancelled, crashed runs continue where the policy says so.

The queue of a station gives out one run at a time. The rest is the policy of the deployment
(:mod:`pipelines.orchestrator.policy`). The first process of a worker applies it when it starts and every ``EVERY_S`` seconds,
also while its worker is busy or dead. It also closes runs whose process ended while the server was away, which would keep their
position in the queue for ever.
"""

import threading
from collections import defaultdict
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from functools import partial
from time import monotonic
from typing import Any, cast
from uuid import UUID

from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas import filters
from prefect.client.schemas.objects import FlowRun, StateType
from prefect.client.schemas.sorting import FlowRunSort
from prefect.states import Cancelled, Scheduled

from pipelines.orchestrator.dead_runs import SILENCE_S, WORKING, LostRuns, lives, runs_of_queue
from pipelines.orchestrator.policy import policy_of_tags
from pipelines.orchestrator.worker_health import in_thread
from schemas.log_lines import tell

EVERY_S = 10.0
GRACE = timedelta(seconds=5)
"""Time that a worker may need to take a run that is due; until then a busy station is no reason to skip it."""

ATTEMPTS = 3
CONTINUED_WITHIN = timedelta(hours=2)
"""A run that crashed earlier is not continued automatically: the lot may have been unloaded."""

MISSED = "missed: its start was at {when}, and it could not start within {limit:.0f} min; policy missed={missed}"
SKIPPED = "skipped: at {when} the station was busy with run {other}; policy busy=skip"
CONTINUED = "continues from its checkpoint after a crash, attempt {attempt} of {attempts}; policy crashed=continue"


SETTLED = timedelta(seconds=SILENCE_S + 15)
"""Time after a crash in which the worker of Prefect may still hold the run's slot, and exits if it receives the run again, and in
which the server may still close the run for the heartbeat that its dead process owes."""


def apply_rules(pool: str, queue: str, now: datetime | None = None) -> list[str]:
    """Apply the policies to the runs of a queue; one sentence for each run that changed."""
    at = now or datetime.now(UTC)
    with get_client(sync_client=True) as client:
        return [
            *_continue_crashed(client, pool, queue, at),
            *_cancel_missed(client, pool, queue, at),
            *_skip_where_busy(client, pool, queue, at),
        ]


@contextmanager
def applied(pool: str, queues: Sequence[str], worker: str) -> Generator[None]:
    """A context in which the rules are applied to the queues every ``EVERY_S`` seconds, in a thread of this process.

    worker : name of the worker of Prefect that takes the runs
    """
    lost = {queue: LostRuns(pool, queue, worker) for queue in queues}
    with in_thread("queue rules", partial(_repeat, pool, lost)):
        yield


def _repeat(pool: str, lost: Mapping[str, LostRuns], ended: threading.Event) -> None:
    fault = ""
    while not ended.wait(EVERY_S):
        try:
            for queue, runs in lost.items():
                with get_client(sync_client=True) as client:
                    closed = runs.close(client, monotonic())
                texts = [f"run {run} is closed as crashed: its process has ended" for run in closed]
                for text in (*texts, *apply_rules(pool, queue)):
                    tell(f"{queue}: {text}", event="rule_applied", queue=queue)
            if fault:
                tell("orchestrator: the server answers again, the rules of the queues are applied")
            fault = ""
        except Exception as problem:  # noqa: BLE001 - without the server the worker waits; the rules wait with it
            if not fault:
                text = f"orchestrator: the rules of the queues are not applied ({type(problem).__name__}: {problem})"
                tell(text, level="error", event="rules_not_applied")
            fault = str(problem) or type(problem).__name__


def _cancel_missed(client: SyncPrefectClient, pool: str, queue: str, now: datetime) -> list[str]:
    """Cancel scheduled runs that are later than their policy allows.

    Where it says ``missed=latest``, the newest run of a deployment that is due stays: a missed one runs where no newer is due.
    """
    due: dict[object, list[FlowRun]] = defaultdict(list)
    for run in _due(client, pool, queue, now):
        due[run.deployment_id].append(run)
    texts: list[str] = []
    for runs in due.values():
        policy = policy_of_tags(runs[-1].tags)
        for run in runs[:-1] if policy.missed == "latest" else runs:
            if now - _start(run) <= policy_of_tags(run.tags).latest_start:
                continue
            message = MISSED.format(when=_text(_start(run)), limit=policy.latest_start_min, missed=policy.missed)
            texts += _cancelled(client, run, message)
    return texts


def newer_run(deployment: str, start: datetime, now: datetime | None = None) -> str:
    """Name of a run of the deployment's schedule that was due after ``start`` and is not cancelled; empty where there is none."""
    # as Any: Prefect names another type for times, and takes those of Python
    after, before = cast("Any", start + timedelta(milliseconds=1)), cast("Any", now or datetime.now(UTC))
    with get_client(sync_client=True) as client:
        runs = client.read_flow_runs(
            flow_run_filter=filters.FlowRunFilter(
                expected_start_time=filters.FlowRunFilterExpectedStartTime(after_=after, before_=before)
            ),
            deployment_filter=filters.DeploymentFilter(id=filters.DeploymentFilterId(any_=[UUID(deployment)])),
            sort=FlowRunSort.EXPECTED_START_TIME_DESC,
        )
    return next((run.name for run in runs if run.auto_scheduled and run.state_type != StateType.CANCELLED), "")


def _cancelled(client: SyncPrefectClient, run: FlowRun, message: str) -> list[str]:
    """Cancel a run that has not been taken; the sentence about it, none where a worker was faster.

    The state is read again immediately before, and is not forced: a run that a worker takes in between is refused its start
    by the server, which does not let a cancelled run begin.
    """
    if client.read_flow_run(run.id).state_type != StateType.SCHEDULED:
        return []
    client.set_flow_run_state(run.id, Cancelled(message=message))
    cancelled = client.read_flow_run(run.id).state_type == StateType.CANCELLED
    return [f"run {run.name} is cancelled: {message}"] if cancelled else []


def _skip_where_busy(client: SyncPrefectClient, pool: str, queue: str, now: datetime) -> list[str]:
    """Cancel scheduled runs with ``busy=skip`` that are due while another run has the station."""
    due = [run for run in _due(client, pool, queue, now - GRACE) if policy_of_tags(run.tags).busy == "skip"]
    working = runs_of_queue(client, pool, queue, (*WORKING, StateType.PAUSED)) if due else []
    texts: list[str] = []
    for run in due if working else ():
        texts += _cancelled(client, run, SKIPPED.format(when=_text(_start(run)), other=working[0].name))
    return texts


def _continue_crashed(client: SyncPrefectClient, pool: str, queue: str, now: datetime) -> list[str]:
    """Schedule runs again that crashed, with the same id, so that they continue their capture in the archive."""
    texts: list[str] = []
    crashed = runs_of_queue(client, pool, queue, (StateType.CRASHED,), FlowRunSort.EXPECTED_START_TIME_DESC)
    for run in crashed:
        # a living run still drives the station: the server missed its heartbeats
        if policy_of_tags(run.tags).crashed != "continue" or lives(run):
            continue
        if run.state is None or not SETTLED <= now - run.state.timestamp <= CONTINUED_WITHIN:
            continue
        # not run_count: a run whose process could not start has none
        crashes = sum(state.type == StateType.CRASHED for state in client.read_flow_run_states(run.id))
        # a run that has not crashed now was continued by another worker, which was faster
        if crashes >= ATTEMPTS or client.read_flow_run(run.id).state_type != StateType.CRASHED:
            continue
        message = CONTINUED.format(attempt=crashes + 1, attempts=ATTEMPTS)
        client.set_flow_run_state(run.id, Scheduled(scheduled_time=now, message=message), force=True)
        texts.append(f"run {run.name} {message}")
    return texts


def _due(client: SyncPrefectClient, pool: str, queue: str, now: datetime) -> list[FlowRun]:
    """Runs of a schedule that should have started and have not, in the order of their start; none that a person started."""
    runs = runs_of_queue(client, pool, queue, (StateType.SCHEDULED,))
    return [run for run in runs if run.auto_scheduled and run.run_count == 0 and _start(run) <= now]


def _start(run: FlowRun) -> datetime:
    return run.expected_start_time or datetime.max.replace(tzinfo=UTC)


def _text(when: datetime) -> str:
    return when.isoformat(timespec="minutes")
