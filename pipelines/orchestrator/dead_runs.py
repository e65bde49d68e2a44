"""Flow runs that the orchestrator lists as running although their process has ended.

Where no process at the station can close such a run, the server does. A flow sends a heartbeat every ``HEARTBEAT_S`` (the
shortest period that Prefect allows). An automation of the server marks a run as crashed that has sent none for ``SILENCE_S`` and
has no final state: its computer has no power, or its network is down.
"""

import os
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from time import monotonic, sleep
from uuid import UUID

from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas import filters
from prefect.client.schemas.objects import FlowRun, StateType
from prefect.client.schemas.sorting import FlowRunSort
from prefect.events.actions import ActionTypes, ChangeFlowRunState
from prefect.events.schemas.automations import AutomationCore, EventTrigger, Posture
from prefect.events.schemas.events import ResourceSpecification
from prefect.states import Crashed

PROCESSES = Path("/proc")
OF_KERNEL = 0x00200000  # flag of a thread of the kernel (PF_KTHREAD of Linux), which never has an environment
STARTED_WITHIN = timedelta(seconds=1)
"""Longest time for which a process that is being started may have no environment yet."""

MANY = 200  # largest page of the server
WORKING = (StateType.PENDING, StateType.RUNNING, StateType.CANCELLING)
LOST_S = 60.0
"""Longest time from the moment at which a worker takes a run to the start of its process, s, with a large margin."""

SUSPENDED = "Suspended"  # such a run has no process, and gets one when it is resumed
WORKER = "prefect.worker.name"  # label that the worker of Prefect gives to the runs that it takes
GONE = "its process has ended: it was killed, or its worker ended; give the same order again to continue"


def close_dead_runs(name: str) -> None:
    """Mark flow runs of a name as crashed whose process was killed and which the orchestrator still lists as running."""
    message = "its process was killed; another flow run of this name continues its work"
    with get_client(sync_client=True) as client:
        for run in runs_of_name(client, name):
            if run.state_type == StateType.RUNNING:
                client.set_flow_run_state(run.id, Crashed(message=message), force=True)


def runs_of_name(client: SyncPrefectClient, name: str) -> list[FlowRun]:
    """Flow runs of a name, the newest first."""
    flow_filter = filters.FlowRunFilter(name=filters.FlowRunFilterName(any_=[name]))
    return client.read_flow_runs(flow_run_filter=flow_filter, sort=FlowRunSort.START_TIME_DESC, limit=MANY)


def close_dead_runs_of_queue(pool: str, queue: str, worker: str = "") -> list[str]:
    """Mark the runs of a station's queue as crashed that began and have no process; return their names.

    A run that another worker took is left alone, as its process may live on another computer: the server closes it when its
    heartbeat stops (:func:`have_automation`).
    """
    with get_client(sync_client=True) as client:
        dead = _without_process(client, pool, queue, worker)
        for run in dead:
            client.set_flow_run_state(run.id, Crashed(message=GONE), force=True)
    return [run.name for run in dead]


def _without_process(client: SyncPrefectClient, pool: str, queue: str, worker: str) -> list[FlowRun]:
    """Runs in progress that no other worker took and that have no process on this computer."""
    return [
        run
        for run in runs_of_queue(client, pool, queue, (*WORKING, StateType.PAUSED))
        if not (worker and run.labels.get(WORKER, worker) != worker)
        and not (run.state and run.state.name == SUSPENDED)
        and not lives(run)
    ]


class LostRuns:
    """Runs of a station's queue whose process ended while the server could not be told, while their worker goes on.

    Such a run never begins or ends by itself, and the queue gives out no other run: a run that had not begun yet has no heartbeat
    that could stop. A worker that has just taken a run has no process for it either, so a run is closed when that was so for
    ``LOST_S`` in one state. The time is that of this computer since its start: whether its clock is right does not matter.
    """

    def __init__(self, pool: str, queue: str, worker: str) -> None:
        self._where = (pool, queue, worker)
        self._since: dict[tuple[UUID, UUID | None], float] = {}

    def close(self, client: SyncPrefectClient, now: float) -> list[str]:
        """Mark the lost runs as crashed; return their names. ``now``, s, is of a clock that only counts on."""
        lost = {(run.id, run.state_id): run for run in _without_process(client, *self._where)}
        self._since = {key: self._since.get(key, now) for key in lost}
        closed: list[str] = []
        for key, run in lost.items():
            # a process that has ended changes no state after this look
            if now - self._since[key] >= LOST_S and client.read_flow_run(run.id).state_id == run.state_id:
                client.set_flow_run_state(run.id, Crashed(message=GONE), force=True)
                closed.append(run.name)
        return closed


def runs_of_queue(
    client: SyncPrefectClient,
    pool: str,
    queue: str,
    states: Sequence[StateType],
    sort: FlowRunSort = FlowRunSort.EXPECTED_START_TIME_ASC,
) -> list[FlowRun]:
    """Flow runs of a work queue in one of the states, in the order of their start."""
    return client.read_flow_runs(
        flow_run_filter=filters.FlowRunFilter(
            state=filters.FlowRunFilterState(type=filters.FlowRunFilterStateType(any_=list(states)))
        ),
        work_pool_filter=filters.WorkPoolFilter(name=filters.WorkPoolFilterName(any_=[pool])),
        work_queue_filter=filters.WorkQueueFilter(name=filters.WorkQueueFilterName(any_=[queue])),
        sort=sort,
        limit=MANY,
    )


def lives(run: FlowRun) -> bool:
    """Whether a process of this computer still works on a run; its number alone may belong to a newer process.

    Where the number is not known, since the server was away when the process started, every process is looked at.
    """
    pid = run.infrastructure_pid
    if pid and not pid.isdecimal():
        return False
    processes = (
        [PROCESSES / pid] if pid else [process for process in PROCESSES.glob("[0-9]*") if process.name.isdecimal()]
    )
    mark = f"PREFECT__FLOW_RUN_ID={run.id}".encode()
    return any(mark in _environment(process).split(b"\0") for process in processes if int(process.name) != os.getpid())


def _environment(process: Path) -> bytes:
    """Environment of a process as ``/proc`` tells it; empty where the process has ended.

    A process that is just being started has none for a moment: it is asked again until it has, for at most ``STARTED_WITHIN``.
    """
    until = monotonic() + STARTED_WITHIN.total_seconds()
    try:
        while not (environment := (process / "environ").read_bytes()):
            # state and flags follow the name, which may hold brackets itself; Z: ended, and not yet collected by its parent
            state, *_, flags = (process / "stat").read_text(errors="replace").rpartition(")")[2].split()[:7]
            if state in "ZX" or int(flags) & OF_KERNEL or monotonic() > until:
                break
            sleep(0.01)
    except OSError:
        return b""
    return environment


HEARTBEAT_S = 30
SILENCE_S = 60
FREQUENCY = "PREFECT_FLOWS_HEARTBEAT_FREQUENCY"
NAME = "tumbleline: runs without a heartbeat"
HEARTBEAT = "prefect.flow-run.heartbeat"
ENDS = ("Completed", "Failed", "Cancelled", "Crashed", "Suspended")
"""Events after which no heartbeat follows; a suspended run waits for the operator without a process."""

MESSAGE = f"no heartbeat for {SILENCE_S} s: its computer or its network is down"


def have_automation() -> None:
    """Make or renew the automation of the server."""
    ends = {f"prefect.flow-run.{end}" for end in ENDS}
    close: list[ActionTypes] = [
        ChangeFlowRunState(state=StateType.CRASHED, name="Crashed", message=MESSAGE, force=False)
    ]
    _keep(
        AutomationCore(
            name=NAME,
            description="Made by pipelines.flows.deploy; changes are overwritten there.",
            enabled=True,
            trigger=EventTrigger(
                after={HEARTBEAT},
                expect={HEARTBEAT, *ends},
                match=ResourceSpecification({"prefect.resource.id": ["prefect.flow-run.*"]}),
                for_each={"prefect.resource.id"},
                posture=Posture.Proactive,
                threshold=1,
                within=timedelta(seconds=SILENCE_S),
            ),
            actions=close,
        )
    )


def _keep(automation: AutomationCore) -> None:
    """Make an automation, or update the existing automation of the name; further automations of the name are removed."""
    with get_client(sync_client=True) as client:
        same = [existing.id for existing in client.read_automations_by_name(automation.name)]
        if not same:
            client.create_automation(automation)
            return
        client.update_automation(same[0], automation)
        for further in same[1:]:
            client.delete_automation(further)
