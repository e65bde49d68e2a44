"""A clock that jumps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class ClockJump(Trouble):
    """The clock of the computer that drives the station jumps by ``step_s`` seconds."""

    kind: ClassVar[str] = "clock_jump"

    step_s: float = 30.0

    def begins(self, plant: Plant) -> None:
        """It jumps."""
        plant.clock_off_s += self.step_s
