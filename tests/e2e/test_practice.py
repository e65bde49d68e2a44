"""The station to practise on: served by ``demo --station``, and the page that measures, disturbs, kills and continues on it."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import browser
import printed_pages as pages
import pytest
from in_process import document_of, given, typed_document

from pipelines.demo.practice import RECIPE, TypedFaults, practice_file, practice_lot
from schemas.station import load_station
from stations.opening import make_plant

PAGE = "docs/tutorial/practise-on-a-station.md"
TUMBLELINE = [sys.executable, "-m", "pipelines.cli"]


@pytest.fixture(autouse=True)
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty folder to work in, with leases and an archive of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", "archive")
    monkeypatch.setenv("PYTHONPATH", str(pages.ROOT))


@contextmanager
def started(*words: str) -> Iterator[subprocess.Popen[str]]:
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen([*TUMBLELINE, *words], text=True, **pipes) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.communicate(timeout=20.0)


def until(happened: Callable[[], bool], what: str) -> None:
    """Wait for another process; a busy machine starts the orchestrator alone in half a minute."""
    browser.until(happened, what, 300.0)


@pytest.mark.slow  # its file and its faults: the test below; a served station: test_station.py
def test_the_served_station_is_reached_by_the_file_that_it_writes_and_takes_typed_faults(tmp_path: Path) -> None:
    where = tmp_path / "line" / "station.toml"
    with started("demo", "--station", "--folder", "line", "--json") as process:
        text = "".join(iter(process.stdout.readline, "}\n")) + "}\n"
        document = typed_document("demo", text)
        assert (document["station"], document["speed"]) == ("line/station.toml", load_station(where).link.speed)
        process.stdin.write("door:for_s=100000\nnonsense\n")
        process.stdin.flush()
        until(lambda: document_of("station", "status", "--station", where)["door"] == "open", "an open door")
        serials = [slot["serial"] for slot in document_of("station", "status", "--station", where)["slots"]]
        assert serials == document["units"] == [unit.serial for unit in practice_lot().units]
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=20.0)[1]
    assert process.returncode == 0
    assert "door:for_s=100000: begins now, ends in 100000 s" in told
    assert "no kind 'nonsense'" in told


def test_a_line_that_comes_in_parts_is_one_fault_and_the_end_of_the_input_is_none() -> None:
    plant, told = make_plant(load_station(), practice_lot()), list[str]()
    plant.advance(5_000_000)
    read, write = os.pipe()
    faults = TypedFaults(told.append, read)
    for part in (b"do", b"or\n\nvibration:", b""):
        if part:
            os.write(write, part)
        else:
            os.close(write)
        faults(plant)
    faults(plant)
    os.close(read)
    assert (told, [fault.order.at_s for fault in plant.faults]) == (["door: begins now"], [5.0])
    _, config = practice_file(5021)  # one of hardware but for addresses and clock
    assert (config.kind, config.simulation) == ("modbus", None)
    assert {device.port for device in (config.devices.outer, config.devices.chamber, config.devices.slots)} == {5021}
    assert config.devices.slots.profile == load_station().devices.slots.profile


def recorded() -> int:
    return len(list(Path("archive").glob("captures/*/[0-9]*/samples.parquet")))


def same(shown: str, printed: str) -> str:
    """How a text differs from that of the page, whatever names, numbers and processes are."""
    shown, printed = (re.sub(rf"{RECIPE}[- ][0-9a-f]{{8,}}", "RUN", text) for text in (shown, printed))
    shown, printed = (
        re.sub(r"127\.0\.0\.1:\d+", "ADDRESS", text) for text in (shown, printed)
    )  # its port may be taken
    return pages.unlike(f"{shown} ", printed, 1.0)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_page_measures_opens_the_door_kills_continues_and_certifies() -> None:
    steps = iter(pages.examples(PAGE))

    def shown(*beginning: str, columns: int = 100) -> None:
        command, printed = next(steps)
        words = command.split()[1:]
        assert tuple(words[: len(beginning)]) == beginning
        status, out, err = given(*words, columns=columns)
        assert status == 0, err
        assert same(out, printed) == "", command

    command, printed = next(steps)
    with started(*command.split()[1:]) as station:
        said = "".join(iter(station.stdout.readline, "\n"))
        assert not same(said, printed.replace("…", ""))
        shown("station", "status")
        command, printed = next(steps)
        assert not printed
        with started(*command.split()[1:]) as run:
            until(lambda: recorded() > 0 or run.poll() is not None, "a record")
            assert run.poll() is None, run.communicate()
            station.stdin.write(re.search(r"^ +(door:.*)$", pages.text(PAGE), re.MULTILINE)[1] + "\n")
            station.stdin.flush()
            until(lambda: "suspended" in given("station", "log")[1], "a pause")
            shown("station", "log")
            until(lambda: "resumed" in given("station", "log")[1], "the end of the pause")
            driven = given("station", "status", "--station", "demo/station.toml")[1]
            assert f"process {run.pid}" in driven
            os.kill(run.pid, signal.SIGKILL)
        before = recorded()
        until(lambda: "watchdog safe" in given("station", "log")[1], "the safe state")
        shown("station", "log")
        assert recorded() == before
        shown("run", columns=160)
        shown("certificate", "issue")
        shown("show", "PR-01")
    assert next(steps, None) is None
    assert document_of("station", "log", "latest")["events"][0]["kind"] == "suspended"
