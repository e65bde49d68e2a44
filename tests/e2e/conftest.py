"""What the tests of commands have in common: no signing key of the user, and copies of a line with one finished run."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import chromium
from capture_double import finished_run
from judged_once import judged_once
from root_process import ROOT

from pipelines.archive import Archive
from pipelines.archive.signatures import VARIABLE

sys.path.insert(0, str(ROOT / "benchmarks/worlds"))  # a generator of lots with something hidden in them


@pytest.fixture(scope="package", autouse=True)
def no_key_of_the_user() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        yield


@pytest.fixture(scope="package", autouse=True)
def one_judgement_of_a_lot() -> Iterator[None]:
    with judged_once():
        yield


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def line(home: Path) -> Path:
    """The working folder of a line: its recipe, and in ``archive`` a copy of one finished run."""
    finished_run(home)
    return home


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    """An archive with one finished run, to be read only."""
    return finished_run(tmp_path_factory.mktemp("measured")).archive


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    """A browser for the tests of a file; while it is open no other test of the process can have an event loop."""
    with chromium() as launched:
        yield launched
