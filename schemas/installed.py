"""Libraries that cannot be imported: a fault of the installation, not of the program. Needs the standard library alone."""

import re
import sys
import traceback
from pathlib import Path

from schemas.shipped import shipped

LOCK = "requirements-run.lock"
_TREE = Path(__file__).resolve().parents[1]
_OWN = ("inertial", "schemas", "stations", "pipelines", "tumbleline", "deploy")


def not_installed(problem: BaseException | None) -> str | None:
    """One line that names the library and the remedy; None where an exception is not of the import of a library.

    A module of this product, and what a file of the user imports, are no libraries of the installation.
    """
    while problem is not None and not isinstance(problem, ImportError):
        problem = problem.__cause__
    frames = traceback.extract_tb(problem.__traceback__) if problem is not None else []
    if problem is None or not frames or not _is_of_installation(frames[-1].filename):
        return None
    missing = isinstance(problem, ModuleNotFoundError)
    if missing and problem.name:
        library = problem.name.partition(".")[0]
    elif frames[-1].name == "<module>" and _libraries_of(frames[-1].filename):  # it is there, and does not load
        library = _libraries_of(frames[-1].filename)[0].removesuffix(".py")
    else:
        return None
    if library in _OWN:
        return None
    lines = str(problem).strip().splitlines()
    found = "is not installed" if missing else f"cannot be loaded ({lines[0] if lines else 'no reason is given'})"
    return to_complete(library, found)


def missing_in(log: str) -> str | None:
    """As :func:`not_installed`, for the output of a process of this environment; None where it names no missing library."""
    names = re.findall(r"^ModuleNotFoundError: No module named '([\w]+)", log, re.MULTILINE)
    return to_complete(names[-1], "is not installed") if names and names[-1] not in _OWN else None


def to_complete(library: str, found: str) -> str:
    """The line about a library: what is wrong with it, and the call that installs what the lock has."""
    lock = shipped(LOCK)
    words = f"--no-deps --require-hashes -r {lock}" if lock is not None else "tumbleline"
    return (
        f"the library '{library}' {found}: the environment {sys.prefix} is not complete; "
        f"run: {sys.executable} -m pip install --force-reinstall {words}"
    )


def _is_of_installation(file: str) -> bool:
    folders = [_TREE / name for name in _OWN]
    return bool(_libraries_of(file)) or any(Path(file).is_relative_to(folder) for folder in folders)


def _libraries_of(file: str) -> tuple[str, ...]:
    """Parts of the path of a module below the folder of the libraries; empty where it is not below it."""
    parts = Path(file).parts
    for folder in ("site-packages", "dist-packages"):
        if folder in parts:
            return parts[parts.index(folder) + 1 :]
    return ()
