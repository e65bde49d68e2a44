"""A supply that sags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import UNIT, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class SupplySag(Trouble):
    """The supply of a unit, or of all, falls by the part ``part``; outputs that follow it fall with it, others shift."""

    kind: ClassVar[str] = "supply_sag"
    about: ClassVar[tuple[str, ...]] = (UNIT, "reader")

    part: float = 0.1

    def begins(self, plant: Plant) -> None:
        """Down."""
        plant.sag(self._meant(plant), 1.0 - self.part)

    def ends(self, plant: Plant) -> None:
        """Up."""
        plant.sag(self._meant(plant), 1.0)

    def _meant(self, plant: Plant) -> list[int]:
        return [self.unit] if self.fault.serial else list(range(len(plant.slots)))
