"""The emergency stop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class EmergencyStop(Trouble):
    """The emergency stop is pressed: both axes stop where they are and hold."""

    kind: ClassVar[str] = "emergency_stop"

    def begins(self, plant: Plant) -> None:
        """Pressed."""
        plant.emergency_stop = True
        for axis in (plant.outer, plant.inner):
            axis.stall(plant.now)

    def ends(self, plant: Plant) -> None:
        """Released; what was interrupted is not gone on with."""
        plant.emergency_stop = False
        for axis in (plant.outer, plant.inner):
            axis.release(plant.now, resumes=False)
