"""Markers by folder, and the folder of real measurements."""

import gc
import os
from collections.abc import Generator, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import settings
from once import begin, end
from orchestrator import LOG, errors_in
from threadpoolctl import threadpool_limits

from inertial import effects

ROOT = Path(__file__).resolve().parent.parent
for _name in ("COLUMNS", "LINES"):
    # workers of pytest-xdist have those of a terminal; the output of the tests goes into pipes
    os.environ.pop(_name, None)


def fsync(fd: object) -> None:
    """In place of ``os.fsync``: no test cuts the power, and a run waits for the disk some hundred times."""


os.fsync = fsync
threadpool_limits(1)  # small matrices take six times as long where the threads of several workers wait for each other
pytest_plugins = ("left_open",)
# other work on the machine decides how long a case takes
settings.register_profile("busy", deadline=None, max_examples=40)
settings.load_profile("busy")

FOLDERS = ("unit", "property", "contract", "reference", "faults", "e2e", "blind")


def pytest_configure(config: pytest.Config) -> None:
    """Begins a session of what is made once, before there are further processes, and ends it after them."""
    if begin():
        config.add_cleanup(end)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        parts = Path(item.path).relative_to(ROOT / "tests").parts
        if parts[0] in FOLDERS:
            item.add_marker(getattr(pytest.mark, parts[0]))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collects without searches for garbage, a quarter of its time: what it makes stays until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_finish() -> None:
    """Leaves what the collection has made, which stays until the end, out of every later search for garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real measurements; skips where it is missing."""
    folder = Path(os.environ.get("TUMBLELINE_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no folder of real measurements at {folder}; set TUMBLELINE_DATA")
    return folder


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own for what the machine keeps of its stations: leases, notes, histories."""
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def rng() -> np.random.Generator:
    """A seeded generator."""
    return np.random.default_rng(20260101)


@pytest.fixture(autouse=True)
def effects_of_one_test() -> Iterator[None]:
    """Forgets effects that a test adds to the catalogue: the tests of a process come in any order."""
    with effects.additions_forgotten():
        yield


@pytest.fixture(autouse=True)
def no_error_of_a_server(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fails a test in whose folder an orchestrator's server has logged an error, whoever started it."""
    folder = request.getfixturevalue("tmp_path") if "tmp_path" in request.fixturenames else None
    yield
    for log in folder.rglob(LOG) if folder is not None else ():
        assert not errors_in(log), f"{log} has an error:\n{errors_in(log)}"


@pytest.fixture
def no_next_measurement(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Diagnoses without proposed measurements, for tests of what is said of the measured ones: proposals are most of the time.

    In the slow suites the document is whole, and so is that of every command and every blind run.
    """
    if request.node.get_closest_marker("slow") is None:
        monkeypatch.setattr("pipelines.diagnosis.diagnose.proposed", lambda _: SimpleNamespace(rows=list))
