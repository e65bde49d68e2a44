"""Expensive things that the tests only read, made once in a session, whichever of its processes needs them first."""

import atexit
import fcntl
import os
import pickle
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Thing = TypeVar("Thing")
VARIABLE = "TESTS_MADE_ONCE"
"""The folder of the session; processes of pytest-xdist inherit it."""


def begin() -> bool:
    """Make the folder of the session, unless it is there; whether it was made here."""
    if VARIABLE in os.environ:
        return False
    os.environ[VARIABLE] = tempfile.mkdtemp(prefix="tumbleline-tests-")
    return True


def end() -> None:
    """Remove the folder of the session."""
    shutil.rmtree(os.environ.pop(VARIABLE), ignore_errors=True)


def once(name: str, make: Callable[[Path], Thing]) -> Thing:
    """What ``make`` gives for a folder of its own; it is made by the first who asks, while the others wait."""
    if begin():
        atexit.register(end)
    top = Path(os.environ[VARIABLE])
    kept = top / f"{name}.pickle"
    with (top / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.is_file():
            folder = top / name
            shutil.rmtree(folder, ignore_errors=True)  # of somebody who could not make it
            folder.mkdir()
            kept.write_bytes(pickle.dumps(make(folder)))
    return pickle.loads(kept.read_bytes())
