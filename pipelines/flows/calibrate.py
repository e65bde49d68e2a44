"""The flow ``calibrate_lot``: the stages of the chain in order, a task per stage of a lot."""

from __future__ import annotations

import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from prefect import flow, task
from prefect.cache_policies import NO_CACHE
from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId, FlowRunFilterName
from prefect.client.schemas.objects import FlowRun, StateType
from prefect.client.schemas.sorting import FlowRunSort, TaskRunSort
from prefect.runtime import flow_run

from pipelines.chain.attendance import JUDGED, Attendance
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Done, Runner
from pipelines.flows.operator import Paused
from pipelines.flows.places import archive_of
from pipelines.jobs.job import Request
from schemas.errors import LinkLost, NotReached, StationTimeout
from schemas.progress import silent

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from pipelines.chain.attendance import Operator
    from schemas.progress import Progress

HISTORY_S = 20.0
MANY = 200  # the server's own largest page
FINAL = {StateType.COMPLETED, StateType.FAILED, StateType.CRASHED, StateType.CANCELLED}

Listener = tuple["Progress", "Callable[[Done], None]", "Operator | None"]

_listeners: list[Listener] = []


@contextmanager
def listening(
    progress: Progress, told: Callable[[Done], None], operator: Operator | None = None
) -> Generator[None, None, None]:
    """A block in which flows of this process tell how far they are, and ask ``operator`` where there is one."""
    _listeners.append((progress, told, operator))
    try:
        yield
    finally:
        _listeners.pop()


def _worth_repeating(task_: Any, task_run: Any, state: Any) -> bool:
    """Whether a stage failed for a link or a device that may come back; a finished record is not measured again."""
    del task_, task_run
    try:
        state.result()
    except NotReached:  # hours have gone by already
        return False
    except (LinkLost, StationTimeout):
        return True
    except Exception:  # noqa: BLE001 - whatever else went wrong would go wrong again
        return False
    return False


@task(
    task_run_name="{name}",
    cache_policy=NO_CACHE,  # the archive's keys decide what is done again, not the orchestrator
    persist_result=False,
    retries=2,
    retry_delay_seconds=10,
    retry_condition_fn=_worth_repeating,
)
def stage(name: str, runner: Runner) -> Done:
    """One stage of the chain."""
    return runner.stage(name)


@flow(name="calibrate_lot", persist_result=False, log_prints=False)
def calibrate_lot(  # noqa: PLR0913 - a flow's parameters are its form on the server's page
    recipe: str = "production",
    station: str | None = None,
    units: list[str] | None = None,
    slots: list[int] | None = None,
    archive: str | None = None,
    seed: int | None = None,
    repeat: int | None = None,
    faults: list[str] | None = None,
    *,
    prompts: bool = False,
) -> str:
    """Measure and calibrate a lot; the id of its run in the archive.

    Without ``repeat`` every flow run measures the lot anew, and a retry of the same flow run goes on where it was. With
    ``prompts`` the flow run pauses for the operator: to load, to put right what is wrong, to unload. ``archive`` holds no
    credentials, see :func:`pipelines.flows.places.archive_of`.
    """
    progress, told, operator = _listeners[-1] if _listeners else (silent, lambda _done: None, None)
    store = archive_of(archive)
    job = requested(recipe, station, units, slots, seed, repeat, faults).job(store)
    runner = Runner(job, store, progress)
    person = operator or (Paused() if prompts else None)
    beside = None if person is None else Attendance(person, job, runner.run.id)
    told(_capture(runner, beside))
    for name in ORDER[1:]:
        told(stage(name, runner))
        if beside is not None and name == JUDGED:
            beside.unload(runner.run)
    return runner.run.id


def requested(
    recipe: str,
    station: str | None,
    units: list[str] | None,
    slots: list[int] | None,
    seed: int | None,
    repeat: int | None,
    faults: list[str] | None,
) -> Request:
    """What a flow run's parameters ask for; without ``repeat`` a count of its own, the same when it is tried again."""
    anew = int(str(flow_run.id).replace("-", "")[:7], 16) if repeat is None else repeat
    where = Path(station) if station else None
    return Request(recipe, where, tuple(units or ()), tuple(slots or ()), seed, anew, tuple(faults or ()))


def _capture(runner: Runner, beside: Attendance | None) -> Done:
    """The capture, with somebody beside it or not."""
    if beside is None:
        return stage("capture", runner)
    return beside.capture(runner, lambda: stage("capture", runner))


def settle_history(name: str, stages: int) -> None:
    """Wait until the server has the final state of the newest flow run of this name and of all its tasks."""
    end = time.monotonic() + HISTORY_S
    with get_client(sync_client=True) as client:
        runs = _flow_runs(client, name)[:1]
        while runs and time.monotonic() < end:
            wanted = FlowRunFilter(id=FlowRunFilterId(any_=[runs[0].id]))
            tasks = client.read_task_runs(flow_run_filter=wanted, sort=TaskRunSort.EXPECTED_START_TIME_ASC, limit=MANY)
            if len(tasks) >= stages and all(one.state_type in FINAL for one in tasks):
                return
            time.sleep(0.1)


def _flow_runs(client: SyncPrefectClient, name: str) -> list[FlowRun]:
    """Flow runs of a name, the newest first."""
    wanted = FlowRunFilter(name=FlowRunFilterName(any_=[name]))
    return client.read_flow_runs(flow_run_filter=wanted, sort=FlowRunSort.START_TIME_DESC, limit=MANY)
