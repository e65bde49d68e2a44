"""Nothing at all comes back from a device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import DEVICES, MUTE, UNIT, Trouble


@dataclass
class Mute(Trouble):
    """Nothing at all comes back from a device, and every request runs into its time-out."""

    kind: ClassVar[str] = "mute"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def answers(self) -> int:
        """None."""
        return MUTE
