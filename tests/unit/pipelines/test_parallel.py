"""A function over partitions: the order of the results, wherever the work is done."""

import ctypes
import os
import subprocess
import sys

import pytest
from partitions import refuse, square, square_and_process
from threadpoolctl import threadpool_info

from pipelines.flows.dask_cluster import on_dask
from pipelines.parallel import map_partitions, one_thread_each
from schemas.errors import DataRejected, LinkLost, WrongUse


def threads(_value: int) -> int:
    import numpy as np

    np.linalg.inv(np.eye(3))
    return max((one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"), default=1)


def test_results_come_in_the_order_of_the_partitions_and_nothing_to_do_starts_nothing() -> None:
    assert map_partitions(square, [3, 1, 2]) == [9, 1, 4]
    assert map_partitions(square, [], on_dask("tcp://127.0.0.1:1")) == []
    assert map_partitions(threads, [1]) == [1]  # every partition is worked on with one thread of BLAS
    with pytest.raises(WrongUse, match="'somewhere' is no address of a scheduler"):
        on_dask("somewhere")


def test_several_workers_are_other_processes_and_keep_the_order() -> None:
    squares, processes = zip(*map_partitions(square_and_process, list(range(5)), workers=2), strict=True)
    assert squares == (0, 1, 4, 9, 16)
    assert os.getpid() not in processes
    with pytest.raises(DataRejected, match="part 1: no dwell"):  # it comes out of a worker as it was
        map_partitions(refuse, [1, 2], workers=2)


@pytest.mark.slow
def test_a_cluster_at_an_address_gives_the_same_results(tmp_path) -> None:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path)
    ) as there:
        squares = map_partitions(
            square, list(range(5)), on_dask(there.scheduler_address, home=tmp_path / "orchestrator")
        )
    assert squares == [0, 1, 4, 9, 16]


@pytest.mark.slow
def test_says_that_no_scheduler_answers(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("pipelines.flows.dask_cluster.CONNECT_S", 1)
    with pytest.raises(LinkLost, match="no Dask scheduler answers"):
        map_partitions(square, [1], on_dask("tcp://127.0.0.1:9", home=tmp_path))


CODE = """
import resource
import numpy as np
def work():
    one = np.ones(400_000)
    other = one * 2.0
    return float((one + other)[-1])
for _ in range(20):
    work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(50):
    work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(before: str = "") -> int:
    """Pages that a child process is given while it makes arrays of 3 MB and drops them; ``before`` is run first."""
    done = subprocess.run([sys.executable, "-c", before + CODE], capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"), reason="no GNU C library")
def test_a_worker_keeps_the_memory_of_its_arrays() -> None:
    plain = faults()
    with one_thread_each():
        kept = faults()
    assert kept < 0.1 * plain, (kept, plain)
    kept = faults("from pipelines.parallel import keep_memory\nkeep_memory()\n")  # from when a process says so
    assert kept < 0.1 * plain, (kept, plain)
