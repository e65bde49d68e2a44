"""The plug-in of the tests that names a test which leaves something open."""

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[2]
LEAKS = """
import asyncio
import socket

import pytest


class Kept:
    \"\"\"Something open in a circle of references: the collector alone ends it.\"\"\"

    def __init__(self, value):
        self.value, self.own = value, self


@pytest.fixture
def of_a_test():
    return Kept(socket.socket())


@pytest.fixture(scope="module")
def of_the_module():
    return Kept(socket.socket())


def test_socket():
    Kept(socket.socket())


def test_file():
    Kept(open(__file__))


def test_loop():
    Kept(asyncio.new_event_loop())


def test_fixture(of_a_test): ...


def test_failing():
    held = Kept(socket.socket())
    assert held is None


def test_closed():
    with socket.socket() as here:
        Kept(here)


def test_last_of_its_module(of_the_module): ...
"""


def test_each_test_that_leaves_something_open_is_named_and_no_other(tmp_path: Path) -> None:
    (tmp_path / "test_leaks.py").write_text(LEAKS, encoding="utf-8")
    options = ["-p", "left_open", "-p", "no:randomly", "-p", "no:cacheprovider", "-W", "error", "-q", "-rE"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--rootdir", tmp_path, *options, tmp_path],
        env={**os.environ, "PYTHONPATH": str(TESTS), "COLUMNS": "200"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    told = {line.split("::")[1].split(" ")[0] for line in done.stdout.splitlines() if line.startswith("ERROR ")}
    assert told == {"test_socket", "test_file", "test_loop", "test_fixture", "test_failing", "test_last_of_its_module"}
    assert "test_socket leaves open:\n  unclosed <socket.socket" in done.stdout
    assert "test_last_of_its_module, or a fixture that ended with it, leaves open:" in done.stdout
    assert "test_file leaves open:\n  unclosed file" in done.stdout
    assert "unclosed event loop" in done.stdout
