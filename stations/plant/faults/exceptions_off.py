"""A device that refuses writes and does not say so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import DEVICES, UNIT, Trouble

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass
class ExceptionsOff(Trouble):
    """A device refuses every write and answers as if it had taken it: its exception answers are switched off (AZ series)."""

    kind: ClassVar[str] = "exceptions_off"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def taken(self, words: list[int], held: list[int] | None, write: Callable[[list[int]], None]) -> int:
        """Nothing is done, and the answer is the usual one."""
        del words, held, write
        return 0
