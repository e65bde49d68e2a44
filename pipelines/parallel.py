"""A function over the partitions of an archive: in this process, in several here, or on Dask workers by Prefect's task runner.

The results come back in the order of the partitions, whoever worked on them, and every partition is worked on with one
BLAS thread: where the work is done changes no byte of what is made.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, TypeVar

from threadpoolctl import threadpool_limits

from pipelines.flows.settings import environment
from schemas.errors import ArchiveUnusable, WrongUse

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence

Part = TypeVar("Part")
Result = TypeVar("Result")

LOCAL = "local"
SCHEMES = ("tcp://", "tls://", "ucx://", "ws://", "wss://")
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def map_partitions(
    function: Callable[[Part], Result],
    partitions: Sequence[Part],
    dask: str | None = None,
    *,
    workers: int = 1,
    home: Path | None = None,
    name: str = "partitions",
) -> list[Result]:
    """What a function makes of every partition, in the order of the partitions.

    Parameters
    ----------
    function : of a module, not of a block: workers import it by its name
    partitions : values that can be pickled
    dask : address of a Dask scheduler, or ``local`` for a cluster of processes on this machine; no Dask where empty or None
    workers : processes on this machine, without Dask or in the local cluster
    home : folder of the orchestrator that is started where PREFECT_API_URL names none; a temporary one where None
    name : of the flow run

    Raises
    ------
    WrongUse
        The address is none.
    """
    if not partitions:
        return []
    if dask:
        _refuse_address(dask)
        with _orchestrator(home):
            from pipelines.flows.dask import run_on_dask  # Prefect reads its settings when it is imported

            return run_on_dask(function, partitions, dask, workers, name)
    if workers <= 1 or len(partitions) == 1:
        return [in_one_thread(function, part) for part in partitions]
    return _in_processes(function, partitions, min(workers, len(partitions)))


def in_one_thread(function: Callable[[Part], Result], part: Part) -> Result:
    """What the function makes of one partition, on one thread of BLAS and of Arrow."""
    import pyarrow as pa

    before = pa.cpu_count()
    pa.set_cpu_count(1)
    try:
        with threadpool_limits(1):
            return function(part)
    finally:
        pa.set_cpu_count(before)


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_thread_each() -> Generator[None, None, None]:
    """A block whose child processes begin with one BLAS thread."""
    with environment(ONE_THREAD):
        yield


def _in_processes(function: Callable[[Part], Result], partitions: Sequence[Part], workers: int) -> list[Result]:
    with one_thread_each(), ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(in_one_thread, function, part) for part in partitions]
        try:
            return [future.result() for future in futures]
        except BrokenProcessPool:
            raise ArchiveUnusable(
                f"partitions: one of {workers} worker processes was killed, each needs memory for a partition; "
                "give fewer workers, and the work goes on where it was"
            ) from None
        finally:
            pool.shutdown(cancel_futures=True)


def _refuse_address(dask: str) -> None:
    if dask != LOCAL and not dask.startswith(SCHEMES):
        raise WrongUse(
            f"--dask: '{dask}' is no address of a scheduler, tcp://HOST:PORT is needed, or '{LOCAL}' for a cluster on this "
            "machine; start one with 'dask scheduler' and 'dask worker'"
        )


@contextmanager
def _orchestrator(home: Path | None) -> Generator[None, None, None]:
    """A block with an orchestrator: the one that PREFECT_API_URL names, or one of our own for as long as it lasts."""
    from pipelines.flows.local import own_server, reach_named

    if os.environ.get("PREFECT_API_URL"):
        reach_named()
        yield
        return
    with TemporaryDirectory(prefix="tumbleline-", ignore_cleanup_errors=True) as spare, own_server(home or Path(spare)):
        yield
