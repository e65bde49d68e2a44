"""A unit whose outputs stay as they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import UNIT, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class Dead(Trouble):
    """The outputs of a unit stay at their last count."""

    kind: ClassVar[str] = "dead"
    about: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, plant: Plant) -> None:
        """They stay."""
        plant.physics.dead_from[self.unit] = self.fault.at_s

    def ends(self, plant: Plant) -> None:
        """They live."""
        plant.physics.dead_from[self.unit] = float("inf")
