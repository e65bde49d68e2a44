"""How long work tells how far it is, without knowing who listens."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Told of work in parts: which part of how many is done, and what it was."""

    def __call__(self, done: int, total: int, note: str) -> None:
        """Take note that ``done`` of ``total`` parts are finished."""
        ...


def silent(done: int, total: int, note: str) -> None:
    """Nobody listens."""
    del done, total, note
