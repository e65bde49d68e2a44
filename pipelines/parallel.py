"""A function over the partitions of an archive: in this process, in several here, or wherever a ``Spread`` takes it.

The results come back in the order of the partitions, whichever process works on them, and every partition is worked on with one
BLAS thread: where the work is done changes no byte of the results.
"""

import os
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from typing import Any, Protocol, TypeVar

from threadpoolctl import threadpool_limits

from schemas.errors import ArchiveUnusable

Partition = TypeVar("Partition")
Result = TypeVar("Result")

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


KEPT_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(2**26), "MALLOC_TRIM_THRESHOLD_": str(2**28)}
"""Variables of the GNU C library by which a process uses memory of arrays of some MB again. Else the system maps every such array
anew, page by page, which is a quarter of the time of an uncertainty budget."""


_MMAP_THRESHOLD, _TRIM_THRESHOLD = -3, -1  # names of the two in <malloc.h>


def keep_memory() -> None:
    """From now on this process uses memory of arrays of some MB again, where its C library is the GNU one."""
    import ctypes

    settings = zip((_MMAP_THRESHOLD, _TRIM_THRESHOLD), KEPT_MEMORY.values(), strict=True)
    with suppress(OSError, TypeError, AttributeError):  # another C library, or another system
        library = ctypes.CDLL(None)
        if hasattr(library, "gnu_get_libc_version"):
            for setting, size in settings:
                library.mallopt(setting, int(size))


class Distributor(Protocol):
    """A way to spread work over other machines, such as :func:`pipelines.flows.dask_cluster.on_dask`."""

    def __call__(self, function: Callable[[Any], Any], partitions: Sequence[Any], name: str) -> list[Any]:
        """What the function makes of every partition, in order; ``name`` is that of the work in logs."""
        ...


def map_partitions(
    function: Callable[[Partition], Result],
    partitions: Sequence[Partition],
    distribute: Distributor | None = None,
    *,
    workers: int = 1,
    name: str = "partitions",
) -> list[Result]:
    """What a function makes of every partition, in the order of the partitions.

    Parameters
    ----------
    function : of a module, not of a block: workers import it by its name
    partitions : values that can be pickled
    distribute : where the work is done instead of on this machine
    workers : processes on this machine, where there is no ``distribute``
    name : of the work in logs
    """
    if not partitions:
        return []
    if distribute is not None:
        return distribute(function, partitions, name)
    if workers <= 1 or len(partitions) == 1:
        return [in_one_thread(function, part) for part in partitions]
    return _in_processes(function, partitions, min(workers, len(partitions)))


def in_one_thread(function: Callable[[Partition], Result], part: Partition) -> Result:
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
    """A block whose child processes begin with one BLAS thread, and keep the memory of their arrays."""
    with with_environment(ONE_THREAD | KEPT_MEMORY):
        yield


@contextmanager
def with_environment(values: Mapping[str, str]) -> Generator[None, None, None]:
    """A block with these variables in the environment, which is as it was after it."""
    before = {key: os.environ.get(key) for key in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for key, value in before.items():
            os.environ.pop(key, None)
            os.environ.update({} if value is None else {key: value})


def _in_processes(
    function: Callable[[Partition], Result], partitions: Sequence[Partition], workers: int
) -> list[Result]:
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
