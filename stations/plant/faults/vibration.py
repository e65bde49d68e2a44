"""Something that shakes the station."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class Vibration(Trouble):
    """Something shakes the fixture: a fork-lift, a press next door."""

    kind: ClassVar[str] = "vibration"

    rms_g: float = 0.02

    def begins(self, plant: Plant) -> None:
        """It shakes."""
        plant.fixture.chamber.shaken_g = self.rms_g

    def ends(self, plant: Plant) -> None:
        """It is gone."""
        plant.fixture.chamber.shaken_g = 0.0
