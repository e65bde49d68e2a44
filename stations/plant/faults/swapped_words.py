"""A device set up with the other word order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import DEVICES, UNIT, Trouble


@dataclass
class SwappedWords(Trouble):
    """A device tells numbers of 32 bits with their words the other way round; its set-up was changed."""

    kind: ClassVar[str] = "swapped_words"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def told(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """Pairs of words exchanged."""
        del now_us, address
        even = len(words) // 2 * 2
        return [word for i in range(0, even, 2) for word in (words[i + 1], words[i])] + words[even:]
