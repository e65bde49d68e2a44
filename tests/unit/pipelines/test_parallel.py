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
def faults():
    for _ in range(50):
        np.ones(400_000) * 2.0 + np.ones(400_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
before = faults()
print(faults() - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"), reason="no GNU C library")
def test_a_worker_keeps_the_memory_of_its_arrays_and_a_process_that_asks_for_it() -> None:
    asked = "from pipelines.parallel import keep_memory\nkeep_memory()\n"
    plain, by_itself = (int(subprocess.check_output([sys.executable, "-c", one + CODE])) for one in ("", asked))
    with one_thread_each():
        worker = int(subprocess.check_output([sys.executable, "-c", CODE]))
    assert max(by_itself, worker) < 0.1 * plain, (by_itself, worker, plain)
