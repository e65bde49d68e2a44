"""A thermometer that says one temperature for ever."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import UNIT, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class FrozenTemperature(Trouble):
    """A thermometer keeps saying what it said: that of a unit, of the chamber, or all of the reader's."""

    kind: ClassVar[str] = "frozen_temperature"
    about: ClassVar[tuple[str, ...]] = (UNIT, "chamber", "reader")

    def begins(self, plant: Plant) -> None:
        """It freezes."""
        if self.fault.device == "chamber":
            plant.frozen_air = plant.air_reading()
            return
        told = plant.temperature_reading()
        meant = [plant.slots[self.unit]] if self.fault.serial else range(len(told))
        plant.frozen |= {slot: told[slot] for slot in meant}

    def ends(self, plant: Plant) -> None:
        """It thaws."""
        plant.frozen_air = None
        plant.frozen.clear()
