"""A write of several registers that a device takes only in part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import AXES, Trouble

if TYPE_CHECKING:
    from collections.abc import Callable


FAILURE = 4


@dataclass
class PartialWrite(Trouble):
    """A device takes the first registers of a write and fails at the rest; what was not written keeps its old value."""

    kind: ClassVar[str] = "partial_write"
    about: ClassVar[tuple[str, ...]] = (*AXES, "chamber", "reader")

    def taken(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """The first half is new, the rest as it was; the trigger of a move comes last, so that nothing moves."""
        if len(words) == 1:
            write(words)
            return 0
        if held is not None:
            half = len(words) // 2
            write(words[:half] + held[half:])
        return FAILURE
