"""The flow ``calibrate_lot``: the stages of the chain in order, a task per stage of a lot."""

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from prefect import flow, task
from prefect.cache_policies import NO_CACHE
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId
from prefect.client.schemas.objects import State, StateType
from prefect.client.schemas.sorting import TaskRunSort
from prefect.runtime import flow_run
from prefect.states import Cancelled

from pipelines.audit.index_growth import add_runs
from pipelines.chain.attendance import JUDGED, Attendance, Operator
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Done, Runner
from pipelines.flows.operator import Paused
from pipelines.jobs.job import Request
from pipelines.orchestrator.archive_address import archive_of
from pipelines.orchestrator.dead_runs import MANY, runs_of_name
from pipelines.orchestrator.policy import policy_of_tags
from pipelines.orchestrator.queue_rules import newer_run
from schemas.errors import LinkLost, NotReached, StationTimeout
from schemas.progress import Progress, silent

HISTORY_S = 20.0
AUTO = "auto-scheduled"  # tag of Prefect on the runs of a schedule
T = TypeVar("T")
FINAL = {StateType.COMPLETED, StateType.FAILED, StateType.CRASHED, StateType.CANCELLED}

listeners: list[tuple[Progress, Callable[[Done], None], Operator | None]] = []
"""To whom flows of this process report progress and stages, and whom they ask: the last one counts."""


@contextmanager
def with_last(listed: list[T], item: T) -> Generator[None]:
    """A context in which an item is appended to a list; it is removed at the end."""
    listed.append(item)
    try:
        yield
    finally:
        listed.pop()


def _worth_repeating(task_: Any, task_run: Any, state: Any) -> bool:
    """Whether a stage failed because of a link or device that may recover; finished records are not measured again."""
    try:
        state.result()
    except Exception as problem:  # noqa: BLE001 - all other errors would occur again
        # a stage that has not reached its condition has already run for hours
        return isinstance(problem, LinkLost | StationTimeout) and not isinstance(problem, NotReached)
    return False


@task(
    task_run_name="{name}",
    cache_policy=NO_CACHE,  # the keys of the archive decide which stages are repeated, not the orchestrator
    persist_result=False,
    retries=2,
    retry_delay_seconds=10,
    retry_condition_fn=_worth_repeating,
)
def stage(name: str, runner: Runner) -> Done:
    """One stage of the chain."""
    return runner.stage(name)


@flow(name="calibrate_lot", persist_result=False, log_prints=False)
def calibrate_lot(  # noqa: PLR0913 - the parameters of a flow are the form on the server's page
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
) -> str | State[Any]:
    """Measure and calibrate a lot; return the id of its run in the archive, or the state of a run that starts too late.

    Without ``repeat`` every flow run measures the lot again, and a retry of the same flow run continues it. With
    ``prompts`` the flow run pauses for the operator: to load, to correct a fault, to unload. ``archive`` has no
    credentials, see :func:`pipelines.orchestrator.archive_address.archive_of`.
    """
    if too_late := late_start():
        return Cancelled(message=too_late)
    progress, report_stage, operator = listeners[-1] if listeners else (silent, lambda _done: None, None)
    store = archive_of(archive)
    job = requested(recipe, station, units, slots, seed, repeat, faults).job(store)
    runner = Runner(job, store, progress)
    person = operator or (Paused() if prompts else None)
    beside = None if person is None else Attendance(person, job, runner.run.id)
    measure = partial(stage, "capture", runner)
    report_stage(measure() if beside is None else beside.capture(runner, measure))
    for name in ORDER[1:]:
        report_stage(stage(name, runner))
        if name == "fit" and (full := runner.full_plan()) is not None:
            for other in ORDER:
                report_stage(stage(other, full))
        if beside is not None and name == JUDGED:
            beside.unload(runner.run)
    add_runs(store, [runner.run.id])
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
    """The request of the parameters of a flow run; without ``repeat`` the number of the flow run, which a retry keeps."""
    anew = int(str(flow_run.id).replace("-", "")[:7], 16) if repeat is None else repeat
    where = Path(station) if station else None
    return Request(recipe, where, tuple(units or ()), tuple(slots or ()), seed, anew, tuple(faults or ()))


def late_start() -> str:
    """Reason why a scheduled run may no longer start; empty where it may.

    The worker cancels such runs (:mod:`pipelines.orchestrator.queue_rules`). One that started in between, for instance when a
    suspended computer resumed, ends here, before anything moves; with ``missed=latest`` where a newer run of its deployment
    is due.
    """
    tags: list[str] = list(flow_run.tags or ())
    if AUTO not in tags or int(flow_run.run_count or 1) > 1:
        return ""
    policy = policy_of_tags(tags)
    late = datetime.now(UTC) - flow_run.scheduled_start_time
    if late <= policy.latest_start:
        return ""
    if policy.missed == "latest":
        newer = newer_run(str(flow_run.deployment_id), flow_run.scheduled_start_time)
        return f"missed: run {newer} of the same deployment is newer; policy missed=latest" if newer else ""
    return (
        f"missed: it starts {late.total_seconds() / 60.0:.0f} min after its time, at most {policy.latest_start_min} min are "
        "allowed; see latest_start_min of the deployment's policy"
    )


def settle_history(name: str, stages: int) -> None:
    """Wait until the server has the final state of the newest flow run of this name and of all its tasks."""
    end = time.monotonic() + HISTORY_S
    with get_client(sync_client=True) as client:
        runs = runs_of_name(client, name)[:1]
        while runs and time.monotonic() < end:
            flow_filter = FlowRunFilter(id=FlowRunFilterId(any_=[runs[0].id]))
            tasks = client.read_task_runs(
                flow_run_filter=flow_filter, sort=TaskRunSort.EXPECTED_START_TIME_ASC, limit=MANY
            )
            if len(tasks) >= stages and all(task.state_type in FINAL for task in tasks):
                return
            time.sleep(0.1)
