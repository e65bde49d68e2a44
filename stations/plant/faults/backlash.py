"""Play between encoder and shaft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import AXES, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class Backlash(Trouble):
    """A worn gear: the shaft stays ``play_deg`` behind the encoder, on the side that it comes from."""

    kind: ClassVar[str] = "backlash"
    about: ClassVar[tuple[str, ...]] = AXES

    play_deg: float = 0.5

    def begins(self, plant: Plant) -> None:
        """The play is there."""
        self.axis(plant).play_deg = self.play_deg

    def ends(self, plant: Plant) -> None:
        """Mended."""
        self.axis(plant).play_deg = 0.0
