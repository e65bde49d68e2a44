"""A drive that has lost its zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import AXES, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class LostHome(Trouble):
    """A drive loses its reference: its angles are off by ``offset_deg``, and its home flag is down unless ``admitted`` is 0."""

    kind: ClassVar[str] = "lost_home"
    about: ClassVar[tuple[str, ...]] = AXES

    offset_deg: float = 3.0
    admitted: float = 1.0

    def begins(self, plant: Plant) -> None:
        """The zero jumps."""
        axis = self.axis(plant)
        axis.lose_zero(self.offset_deg)
        axis.homed = self.admitted == 0.0

    def ends(self, plant: Plant) -> None:
        """It was homed again."""
        axis = self.axis(plant)
        axis.lose_zero(-self.offset_deg)
        axis.homed = True
