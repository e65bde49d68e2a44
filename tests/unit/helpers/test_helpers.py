"""What the helpers of the tests do: rules over many things, wrong clocks, logs of a server, and what a test leaves open."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from each import each
from judged_once import judged_once
from orchestrator import BUSY, errors_in

from pipelines.stages import judge


def test_every_value_is_tried_and_all_that_are_wrong_are_named() -> None:
    seen = []

    @each([1, 2, 3, 4])
    def rule(value: int) -> None:
        seen.append(value)
        assert value != 2
        if value == 4:
            raise KeyError("gone")

    with pytest.raises(AssertionError, match=r"2 of 4 wrong\n2: AssertionError(.|\n)*4: KeyError: 'gone'"):
        rule()
    assert seen == [1, 2, 3, 4]
    with pytest.raises(pytest.skip.Exception):
        each([1, 1])(lambda _: pytest.skip("not here"))()
    with pytest.raises(AssertionError, match="nothing to check"):
        each([])(rule)()


@each(["first", "second"])
def test_every_value_has_a_folder_and_patches_of_its_own(value: str, tmp_path, monkeypatch) -> None:

    assert list(tmp_path.iterdir()) == []
    assert "TUMBLELINE_EACH" not in os.environ
    (tmp_path / value).touch()
    monkeypatch.setenv("TUMBLELINE_EACH", value)


def test_a_run_is_judged_once_for_the_same_dwells_and_model_also_within_two_packages(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(judge, "_judged", lambda *given: (asked.append(given), (judge._not_judged("a test"), None))[1])
    dwells = pd.DataFrame({"out_x": np.random.default_rng(20261130).normal(size=3)})
    with judged_once(), judged_once():
        tables = [judge.judge(dwells.copy(), None, model)["verdict"] for model in (["bias"], ["bias"], ["scale"])]
    assert [table["reason"].item() for table in tables] == ["a test"] * 3
    assert [model for *_, model in asked] == [["bias"], ["scale"]]


def test_an_error_in_a_log_is_found_also_behind_one_that_sqlite_makes_of_itself(tmp_path: Path) -> None:
    log, slow = tmp_path / "log", "02:26:50.483 | WARNING | prefect.server - slow\n"
    busy = f"02:26:50.900 | ERROR   | prefect.server - Encountered error\nTraceback (most\n{BUSY}\n"
    failed = "02:26:49.950 | ERROR   | prefect.server.services.scheduler - Unexpected error\nTraceback (most recent call last):\n"
    assert not errors_in(log)
    for text in (failed, "CRITICAL: x\n", "ERROR:    Exception in ASGI application\n", "Traceback (most\n"):
        log.write_text(slow + text)
        assert errors_in(log).endswith(text)
    log.write_text(slow + busy + "02:26:50.483 | INFO    | x - no ERROR here\n")
    assert not errors_in(log)
    log.write_text(slow + busy + failed + slow)
    assert errors_in(log) == failed


TESTS = Path(__file__).resolve().parents[2]
LEAKS = """
import asyncio
import socket

import pytest


class Kept:
    def __init__(self, value):
        self.value, self.own = value, self  # in a circle: the collector alone ends it


@pytest.fixture(scope="module")
def of_the_module():
    return Kept(socket.socket())


def test_file():
    Kept(open(__file__))


def test_loop():
    Kept(asyncio.new_event_loop())


def test_failing():
    held = Kept(socket.socket())
    assert held is None


def test_closed():
    with socket.socket() as here:
        Kept(here)


def test_last_of_its_module(of_the_module): ...
"""


@pytest.mark.slow
def test_each_test_that_leaves_something_open_is_named_and_no_other(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    monkeypatch.setenv("COLUMNS", "200")
    (tmp_path / "test_leaks.py").write_text(LEAKS, encoding="utf-8")
    options = ["-p", "left_open", "-p", "no:randomly", "-p", "no:cacheprovider", "-W", "error", "-q", "-rE"]
    command = [sys.executable, "-m", "pytest", "--rootdir", tmp_path, *options, tmp_path]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    told = {line.split("::")[1].split(" ")[0] for line in done.stdout.splitlines() if line.startswith("ERROR ")}
    assert told == {"test_file", "test_loop", "test_failing", "test_last_of_its_module"}
    assert "test_last_of_its_module, or a fixture that ended with it, leaves open:" in done.stdout
    assert "test_file leaves open:\n  unclosed file" in done.stdout
    assert "unclosed event loop" in done.stdout
