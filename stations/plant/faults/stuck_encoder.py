"""An encoder that says one angle for ever."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import AXES, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class StuckEncoder(Trouble):
    """An encoder keeps saying the angle that it had; the shaft turns."""

    kind: ClassVar[str] = "stuck_encoder"
    about: ClassVar[tuple[str, ...]] = AXES

    def begins(self, plant: Plant) -> None:
        """It sticks."""
        axis = self.axis(plant)
        axis.stuck_at = axis.encoder(plant.now)

    def ends(self, plant: Plant) -> None:
        """It reads again."""
        self.axis(plant).stuck_at = None
