"""Distribution of work on an archive over Dask workers: a flow ``map_partitions`` of Prefect with a task per partition.

Prefect is imported for work only.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pipelines.flows.local import reached
from pipelines.orchestrator.settings import LOCAL
from pipelines.parallel import Distributor, in_one_thread, one_thread_each
from schemas.errors import LinkLost, WrongUse
from schemas.library import require

SCHEMES = ("tcp://", "tls://", "ucx://", "ws://", "wss://")
CONNECT_S = 10


def on_dask(address: str, workers: int = 1, home: Path | None = None) -> Distributor | None:
    """The distribution over the workers of a Dask cluster; None without an address.

    address : of a Dask scheduler, or ``local`` for a cluster of processes on this machine
    workers : processes of the local cluster
    home : folder of the orchestrator that is started without PREFECT_API_URL; None: a temporary folder

    Raises WrongUse: the address is not the address of a scheduler, or the libraries of Dask are not installed.
    """
    if not address:
        return None
    if address != LOCAL and not address.startswith(SCHEMES):
        raise WrongUse(
            f"--dask: '{address}' is no address of a scheduler, tcp://HOST:PORT is needed, or '{LOCAL}' for a cluster on this "
            "computer; start one with 'dask scheduler' and 'dask worker'"
        )
    require("prefect_dask", "dask", "--dask: work on Dask workers")

    def distribute(function: Callable[[Any], Any], partitions: Sequence[Any], name: str) -> list[Any]:
        with (
            TemporaryDirectory(prefix="tumbleline-", ignore_cleanup_errors=True) as spare,
            reached(home or Path(spare)),
        ):
            return _run_on_dask(function, partitions, address, workers, name)

    return distribute


def _run_on_dask(
    function: Callable[[Any], Any], partitions: Sequence[Any], address: str, workers: int, name: str
) -> list[Any]:
    """Results of all partitions, in order, from a cluster at an address, or from a cluster of processes on this computer."""
    if address != LOCAL:
        _refuse_silent(address)
        return _run(function, partitions, name, address=address)
    with one_thread_each(), TemporaryDirectory(prefix="tumbleline-dask-", ignore_cleanup_errors=True) as scratch:
        cluster = {
            "n_workers": min(workers, len(partitions)),
            "threads_per_worker": 1,
            "processes": True,
            "dashboard_address": None,
            "local_directory": scratch,
        }
        return _run(function, partitions, name, cluster_kwargs=cluster)


def _run(function: Callable[[Any], Any], partitions: Sequence[Any], name: str, **cluster: Any) -> list[Any]:
    """Run the flow; function and partitions are no parameters of it: these are stored, and archives have names."""
    from prefect import flow, task  # it reads its settings when it is imported
    from prefect.cache_policies import NO_CACHE
    from prefect_dask.task_runners import DaskTaskRunner

    runner: Any = DaskTaskRunner(**cluster)

    @task(task_run_name="{label}", cache_policy=NO_CACHE, persist_result=False)
    def partition(label: str, part: Any) -> Any:
        return in_one_thread(function, part)

    @flow(name="map_partitions", flow_run_name=name, task_runner=runner, persist_result=False, log_prints=False)
    def mapped() -> list[Any]:
        width, count = len(str(len(partitions))), len(partitions)
        futures = [partition.submit(f"{k:0{width}d} of {count}", part) for k, part in enumerate(partitions, start=1)]
        return [future.result() for future in futures]

    return mapped()


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
