"""The machine's folder of leases, and its log of events at stations that belong to no archive."""

import json
import os
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from schemas.errors import StationRefused

LOG = "log.jsonl"
VARIABLE = "TUMBLELINE_STATE"


def state_folder() -> Path:
    """The folder in TUMBLELINE_STATE, else the user's state folder; created where it is missing."""
    named = os.environ.get(VARIABLE)
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    folder = Path(named) if named else Path(base) / "tumbleline"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise StationRefused(
            f"leases: {folder} cannot be created ({problem.strerror}), a writable folder is needed; name one in "
            f"{VARIABLE}"
        ) from None
    return folder


def log_event(folder: Path, station: str, event: str, **details: Any) -> bool:
    """Appends a line to the machine's log in one write, so that lines of several processes do not mix.

    Returns whether the line was written: no action for a station's safety depends on its log entry.
    """
    line = {"when": datetime.now(UTC).isoformat(timespec="milliseconds"), "station": station, "event": event, **details}
    data = (json.dumps(line, ensure_ascii=False) + "\n").encode()
    try:
        handle = os.open(folder / LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            return os.write(handle, data) == len(data)
        finally:
            os.close(handle)
    except OSError:
        return False


def read_log(folder: Path) -> list[dict[str, Any]]:
    """Every line of the machine's log in order; an incomplete line is left out."""
    path = folder / LOG
    lines: list[dict[str, Any]] = []
    for line in path.read_text("utf-8", errors="replace").splitlines() if path.is_file() else ():
        with suppress(ValueError):
            lines.append(json.loads(line))
    return lines
