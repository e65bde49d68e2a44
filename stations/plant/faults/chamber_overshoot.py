"""A chamber that goes beyond its set point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class ChamberOvershoot(Trouble):
    """The controller's integral winds up while the actuator is at its end, so that the air goes far beyond the set point."""

    kind: ClassVar[str] = "chamber_overshoot"

    def begins(self, plant: Plant) -> None:
        """It winds up."""
        plant.fixture.chamber.winds_up = True

    def ends(self, plant: Plant) -> None:
        """It does not."""
        plant.fixture.chamber.winds_up = False
