"""Worker processes use the memory of their arrays again; without that every array of some MB is mapped anew."""

import ctypes
import subprocess
import sys

import pytest

from pipelines.parallel import one_thread_each

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


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"), reason="no GNU C library")
def test_a_worker_keeps_the_memory_of_its_arrays() -> None:
    plain = faults()
    with one_thread_each():
        kept = faults()
    assert kept < 0.1 * plain, (kept, plain)


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"), reason="no GNU C library")
def test_a_process_keeps_its_memory_from_when_it_says_so() -> None:
    plain = faults()
    kept = faults("from pipelines.parallel import keep_memory\nkeep_memory()\n")
    assert kept < 0.1 * plain, (kept, plain)
