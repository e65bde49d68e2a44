"""The interface through which long work reports its progress."""

from typing import Protocol


class Progress(Protocol):
    """Receives the progress of work in parts: number of finished parts, total number, and a note."""

    def __call__(self, done: int, total: int, note: str) -> None:
        """Report that ``done`` of ``total`` parts are finished."""


def silent(done: int, total: int, note: str) -> None:
    """Discards the progress."""
