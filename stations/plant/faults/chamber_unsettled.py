"""A chamber that never settles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class ChamberUnsettled(Trouble):
    """The controller hunts: its working set point swings by ``swing_K`` with a period of ``period_s``."""

    kind: ClassVar[str] = "chamber_unsettled"

    swing_K: float = 6.0
    period_s: float = 900.0

    def begins(self, plant: Plant) -> None:
        """It hunts."""
        plant.fixture.chamber.hunting = (self.swing_K, self.period_s)

    def ends(self, plant: Plant) -> None:
        """It is quiet."""
        plant.fixture.chamber.hunting = (0.0, 1.0)
