"""Unexpected exceptions: one line for the user, and a file with the details for the developers."""

import os
import platform
import re
import sys
import tempfile
import traceback
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from schemas.errors import TumblelineError
from schemas.foreign import reason

VARIABLE = "TUMBLELINE_DEBUG"
PREFIX = "unexpected-"
KEPT = 20
_SECRET = re.compile(r"//[^/@\s]+@")


def write_report(problem: Exception) -> str:
    """Write the report; return one line with the kind of the exception and the path of the report."""
    location = _location(problem)
    what = f"unexpected {type(problem).__name__} in {location} ({reason(problem)})"
    report = _written(_report(problem))
    if os.environ.get(VARIABLE):
        sys.stderr.write("".join(traceback.format_exception(problem)))
    if report is None:
        where = f"no report could be written; {VARIABLE}=1 shows it on the screen"
    else:
        where = f"send the report {report}; {VARIABLE}=1 shows it on the screen"
    return f"{what}: a defect of the program, not of its input; {where}"


def _location(problem: Exception) -> str:
    """File and line of this program that the exception passed last."""
    root = Path(__file__).resolve().parents[2]
    frames = traceback.extract_tb(problem.__traceback__)
    inside = [f for f in frames if Path(f.filename).is_relative_to(root) and "site-packages" not in f.filename]
    last = (inside or frames or [None])[-1]
    if last is None:
        return "the command line"
    path = Path(last.filename)
    return f"{path.relative_to(root) if path.is_relative_to(root) else path.name} line {last.lineno}"


def _report(problem: Exception) -> str:
    """Command, versions and traceback, without values of variables and without passwords in addresses."""
    from importlib.metadata import version

    command = " ".join(_SECRET.sub("//…@", word) for word in sys.argv)
    head = [
        f"tumbleline {version('tumbleline')}, Python {platform.python_version()}, {platform.platform()}",
        f"{datetime.now(UTC).isoformat(timespec='seconds')}  in {Path.cwd()}",
        command,
        "",
    ]
    return "\n".join(head) + "".join(traceback.format_exception(problem))


def _written(text: str) -> Path | None:
    """File of the report: in the state folder, else in the folder of temporary files; None where neither can be written."""
    from stations.safety.folder import state_folder

    now = datetime.now(UTC).strftime("%Y%m%dT%H%M%S")
    name = f"{PREFIX}{now}-{os.getpid()}.txt"
    for folder in (state_folder, lambda: Path(tempfile.gettempdir())):
        try:
            path = folder() / name
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
                file.write(text)
        except (OSError, RuntimeError, TumblelineError):  # RuntimeError: no home folder
            continue
        with suppress(OSError):
            for old in sorted(path.parent.glob(f"{PREFIX}*.txt"))[:-KEPT]:  # their names sort by time
                old.unlink(missing_ok=True)
        return path
    return None
