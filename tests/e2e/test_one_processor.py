"""A simulated station and its client stay on one processor, which no other simulated station of the user has."""

import os
import socket
import tempfile
import threading
from pathlib import Path

import pytest
from served_station import served

from stations import serving
from stations.opening import one_processor

pytestmark = pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity") or len(os.sched_getaffinity(0)) < 2, reason="needs two processors"
)


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))  # tests beside this one have claims of their own


def of_new_thread() -> set[int]:
    seen: list[set[int]] = []
    thread = threading.Thread(target=lambda: seen.append(os.sched_getaffinity(0)))
    thread.start()
    thread.join()
    return seen[0]


def test_the_thread_and_those_it_starts_have_one_processor_until_the_block_ends() -> None:
    before = os.sched_getaffinity(0)
    with one_processor():
        own = os.sched_getaffinity(0)
        assert len(own) == 1
        assert of_new_thread() == own
    assert os.sched_getaffinity(0) == before


def test_two_stations_have_different_processors_and_a_third_too_many_has_all() -> None:
    every = os.sched_getaffinity(0)
    taken: list[set[int]] = []
    inside, leave = threading.Semaphore(0), threading.Event()

    def station() -> None:
        with one_processor():
            taken.append(os.sched_getaffinity(0))
            inside.release()
            leave.wait(30.0)

    threads = [threading.Thread(target=station) for _ in range(len(every) + 1)]
    for thread in threads:
        thread.start()
        assert inside.acquire(timeout=30.0)
    leave.set()
    for thread in threads:
        thread.join()
    assert [len(own) for own in taken] == [1] * len(every) + [len(every)]
    assert set.union(*taken[:-1]) == every


def test_without_a_place_for_its_claim_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "/proc/none")
    before = os.sched_getaffinity(0)
    with one_processor():
        assert os.sched_getaffinity(0) == before


def test_a_port_that_another_program_has_just_taken_is_not_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    search = serving._free_port_pair
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = int(other.getsockname()[1])
        offers = iter([taken, taken - 1])  # the port of the Modbus server, then that of the line device beside it
        monkeypatch.setattr(serving, "_free_port_pair", lambda host: next(offers, 0) or search(host))
        with served() as port, socket.create_connection(("127.0.0.1", port), 5.0):
            assert port not in {taken, taken - 1}
