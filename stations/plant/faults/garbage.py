"""A device that tells random words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stations.plant.faults.base import DEVICES, UNIT, Trouble


@dataclass
class Garbage(Trouble):
    """A device tells random words in frames that are whole: a memory gone wrong behind a sound interface."""

    kind: ClassVar[str] = "garbage"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def told(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """Words that depend on the time and the address."""
        rng = np.random.default_rng([now_us, address, self.device_id])
        return rng.integers(0, 65536, len(words)).tolist()
