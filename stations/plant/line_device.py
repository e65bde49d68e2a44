"""A simulated device with a text protocol."""

from __future__ import annotations

from typing import Protocol


class LineDevice(Protocol):
    """A device that answers lines of text."""

    def answer(self, line: str) -> tuple[str, bool]:
        """The answer to a line, and whether the line changed anything."""
        ...
