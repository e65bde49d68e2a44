"""The flow ``map_partitions``: a task per partition, on the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from tempfile import TemporaryDirectory
from typing import Any

from prefect import flow, task
from prefect.cache_policies import NO_CACHE
from prefect_dask.task_runners import DaskTaskRunner

from pipelines.orchestrator.settings import LOCAL
from pipelines.parallel import in_one_thread, one_thread_each
from schemas.errors import LinkLost

CONNECT_S = 10

_work: list[tuple[Callable[[Any], Any], Sequence[Any]]] = []
"""The function and the partitions of the flow of this process. No parameters: these are stored, and archives have names."""


@task(task_run_name="{label}", cache_policy=NO_CACHE, persist_result=False)
def partition(label: str, function: Callable[[Any], Any], part: Any) -> Any:
    """The result of the function for one partition, on any worker."""
    return in_one_thread(function, part)


@flow(name="map_partitions", persist_result=False, log_prints=False)
def mapped() -> list[Any]:
    """The results of the function for all partitions, in order."""
    function, partitions = _work[-1]
    width = len(str(len(partitions)))
    futures = [
        partition.submit(f"{number:0{width}d} of {len(partitions)}", function, part)
        for number, part in enumerate(partitions, start=1)
    ]
    return [future.result() for future in futures]


def run_on_dask(
    function: Callable[[Any], Any], partitions: Sequence[Any], address: str, workers: int, name: str
) -> list[Any]:
    """Results of all partitions, in order, from a cluster at an address, or from a cluster of processes on this computer."""
    if address != LOCAL:
        _refuse_silent(address)
        return _run(DaskTaskRunner(address=address), function, partitions, name)
    with one_thread_each(), TemporaryDirectory(prefix="tumbleline-dask-", ignore_cleanup_errors=True) as scratch:
        cluster = {
            "n_workers": min(workers, len(partitions)),
            "threads_per_worker": 1,
            "processes": True,
            "dashboard_address": None,
            "local_directory": scratch,
        }
        return _run(DaskTaskRunner(cluster_kwargs=cluster), function, partitions, name)


def _run(runner: Any, function: Callable[[Any], Any], partitions: Sequence[Any], name: str) -> list[Any]:
    _work.append((function, partitions))
    try:
        return mapped.with_options(flow_run_name=name, task_runner=runner)()
    finally:
        _work.pop()


def _refuse_silent(address: str) -> None:
    """Refuse an address without a scheduler, or a scheduler without workers, for which the flow would wait forever."""
    from distributed import Client

    try:
        with Client(address, timeout=CONNECT_S, set_as_default=False) as client:
            worker_count = len(client.scheduler_info()["workers"])
    except (OSError, TimeoutError, ValueError) as problem:
        raise LinkLost(
            f"--dask {address}: no Dask scheduler answers within {CONNECT_S} s ({type(problem).__name__}); start it with "
            "'dask scheduler', or correct the address"
        ) from None
    if not worker_count:
        raise LinkLost(
            f"--dask {address}: the scheduler has no worker, at least one is needed; start one with 'dask worker {address}'"
        )
