"""Play between encoder and shaft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import AXES, Fault

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class Backlash(Fault):
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


@dataclass
class LostHome(Fault):
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


@dataclass
class StuckEncoder(Fault):
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


@dataclass
class TableStall(Fault):
    """An axis is held up in its move; when it is free it goes on to its target."""

    kind: ClassVar[str] = "table_stall"
    about: ClassVar[tuple[str, ...]] = AXES

    def begins(self, plant: Plant) -> None:
        """It stands."""
        self.axis(plant).stall(plant.now)

    def ends(self, plant: Plant) -> None:
        """It is free."""
        self.axis(plant).release(plant.now, resumes=True)
