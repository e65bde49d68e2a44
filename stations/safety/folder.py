"""The machine's folder of leases, and its log of what happened to stations outside any archive."""

from __future__ import annotations

import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from schemas.errors import StationRefused

LOG = "log.jsonl"
VARIABLE = "TUMBLELINE_STATE"


def state_folder() -> Path:
    """The folder that TUMBLELINE_STATE names, else the user's own folder for states; made where it is missing."""
    own = os.environ.get(VARIABLE)
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    folder = Path(own) if own else Path(base) / "tumbleline"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise StationRefused(
            f"leases: {folder} cannot be made ({problem.strerror}), a folder that can be written is needed; give one in "
            f"{VARIABLE}"
        ) from None
    return folder


def told(folder: Path, station: str, event: str, **about: Any) -> bool:
    """Keeps a line in the machine's log, whole even when several write: one write to a file opened for appending.

    Whether it could be kept: what is done for a station's safety never depends on a note of it.
    """
    line = {"when": datetime.now(UTC).isoformat(timespec="milliseconds"), "station": station, "event": event, **about}
    data = (json.dumps(line, ensure_ascii=False) + "\n").encode()
    try:
        handle = os.open(folder / LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            return os.write(handle, data) == len(data)
        finally:
            os.close(handle)
    except OSError:
        return False


def log(folder: Path) -> list[dict[str, Any]]:
    """Every line of the machine's log in order; a line that a power cut tore is left out."""
    path = folder / LOG
    if not path.is_file():
        return []
    found: list[dict[str, Any]] = []
    for line in path.read_text("utf-8", errors="replace").splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            continue
    return found
