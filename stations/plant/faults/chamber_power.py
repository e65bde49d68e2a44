"""A chamber without power for heating and cooling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class ChamberPower(Trouble):
    """The chamber loses the power for heating and cooling; its controller goes on answering."""

    kind: ClassVar[str] = "chamber_power"

    def begins(self, plant: Plant) -> None:
        """Off."""
        plant.fixture.chamber.powered = False

    def ends(self, plant: Plant) -> None:
        """On."""
        plant.fixture.chamber.powered = True
