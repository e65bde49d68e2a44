"""An axis that is held up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import AXES, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class TableStall(Trouble):
    """An axis is held up in its move; when it is free it goes on to its target."""

    kind: ClassVar[str] = "table_stall"
    about: ClassVar[tuple[str, ...]] = AXES

    def begins(self, plant: Plant) -> None:
        """It stands."""
        self.axis(plant).stall(plant.now)

    def ends(self, plant: Plant) -> None:
        """It is free."""
        self.axis(plant).release(plant.now, resumes=True)
