"""Resident memory of a process and all its descendants."""

from __future__ import annotations

import resource
from pathlib import Path


def family_bytes(pid: int) -> int:
    """Resident memory of a process and its descendants together, bytes; shared pages count for each process."""
    return sum(_resident(one) for one in _family(pid))


def _family(pid: int) -> list[int]:
    """A process and all its descendants; none when it has ended."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    except OSError:
        return []
    return [pid, *(one for child in children for one in _family(int(child)))]


def _resident(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()
    except (OSError, IndexError):
        return 0
