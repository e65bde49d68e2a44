"""The chamber's door."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class Door(Trouble):
    """The chamber's door is opened."""

    kind: ClassVar[str] = "door"

    def begins(self, plant: Plant) -> None:
        """Open."""
        plant.fixture.chamber.door_open = True

    def ends(self, plant: Plant) -> None:
        """Closed."""
        plant.fixture.chamber.door_open = False
