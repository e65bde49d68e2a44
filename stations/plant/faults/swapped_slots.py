"""Two units that change places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import UNIT, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class SwappedSlots(Trouble):
    """A unit and the next one of the lot change places: each slot has the other's serial number and samples."""

    kind: ClassVar[str] = "swapped_slots"
    about: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, plant: Plant) -> None:
        """They change places."""
        other, seats = (self.unit + 1) % len(plant.serials), plant.seats
        seats[self.unit], seats[other] = seats[other], seats[self.unit]

    def ends(self, plant: Plant) -> None:
        """They change back."""
        self.begins(plant)
