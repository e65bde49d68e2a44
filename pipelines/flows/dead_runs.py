"""Flow runs that the orchestrator believes to be alive though nobody works on them any more."""

from __future__ import annotations

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.filters import (
    FlowRunFilter,
    FlowRunFilterName,
    FlowRunFilterState,
    FlowRunFilterStateType,
    WorkPoolFilter,
    WorkPoolFilterName,
    WorkQueueFilter,
    WorkQueueFilterName,
)
from prefect.client.schemas.objects import StateType
from prefect.client.schemas.sorting import FlowRunSort
from prefect.states import Cancelled, Crashed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from prefect.client.schemas.objects import FlowRun

MANY = 200  # the server's own largest page
WORKING = (StateType.PENDING, StateType.RUNNING, StateType.CANCELLING)
SUSPENDED = "Suspended"  # such a run has given up its process, and gets another when it is resumed
LATE = timedelta(minutes=15)
GONE = "its process is gone: it was killed, or its worker ended; give the same order again, and it goes on where it was"
MISSED = "it was to begin at {when}, when no worker was there; a station does not catch up on runs that were missed"


def close_dead_runs(name: str) -> None:
    """Mark flow runs of a name whose process was killed, which the orchestrator still believes to be running, as crashed."""
    message = "its process was killed; another flow run of this name goes on in its stead"
    wanted = FlowRunFilter(name=FlowRunFilterName(any_=[name]))
    with get_client(sync_client=True) as client:
        found = client.read_flow_runs(flow_run_filter=wanted, sort=FlowRunSort.START_TIME_DESC, limit=MANY)
        for run in found:
            if run.state_type == StateType.RUNNING:
                client.set_flow_run_state(run.id, Crashed(message=message), force=True)


def close_dead_runs_of_queue(pool: str, queue: str) -> list[str]:
    """Names of the runs of a station's queue that were marked as crashed: they began, and their process is gone."""
    closed: list[str] = []
    with get_client(sync_client=True) as client:
        for run in runs_of_queue(client, pool, queue, (*WORKING, StateType.PAUSED)):
            if (run.state and run.state.name == SUSPENDED) or _lives(run):
                continue
            client.set_flow_run_state(run.id, Crashed(message=GONE), force=True)
            closed.append(run.name)
    return closed


def cancel_missed_runs(pool: str, queue: str) -> list[str]:
    """Names of the scheduled runs of a station's queue that were cancelled, as their time passed while no worker was there."""
    cancelled: list[str] = []
    now = datetime.now(UTC)
    with get_client(sync_client=True) as client:
        for run in runs_of_queue(client, pool, queue, (StateType.SCHEDULED,)):
            when = run.expected_start_time
            if run.auto_scheduled and run.run_count == 0 and when is not None and now - when > LATE:
                message = MISSED.format(when=when.isoformat(timespec="minutes"))
                client.set_flow_run_state(run.id, Cancelled(message=message), force=True)
                cancelled.append(run.name)
    return cancelled


def runs_of_queue(client: SyncPrefectClient, pool: str, queue: str, states: Sequence[StateType]) -> list[FlowRun]:
    """Flow runs of a work queue in one of the states, the first to begin first."""
    return client.read_flow_runs(
        flow_run_filter=FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=list(states)))),
        work_pool_filter=WorkPoolFilter(name=WorkPoolFilterName(any_=[pool])),
        work_queue_filter=WorkQueueFilter(name=WorkQueueFilterName(any_=[queue])),
        sort=FlowRunSort.EXPECTED_START_TIME_ASC,
        limit=MANY,
    )


def _lives(run: FlowRun) -> bool:
    """Whether a process of this machine still works on a run; its number alone may belong to another by now."""
    pid = run.infrastructure_pid
    if not pid or not pid.isdecimal():
        return False
    try:
        environment = Path(f"/proc/{pid}/environ").read_bytes()
    except OSError:
        return False
    return f"PREFECT__FLOW_RUN_ID={run.id}".encode() in environment.split(b"\0") and int(pid) != os.getpid()
