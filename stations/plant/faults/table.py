"""Faults of the tilt table's axes."""

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import AXES, Fault
from stations.plant.world import World


@dataclass
class Backlash(Fault):
    """A worn gear: the shaft lags the encoder by a play of ``play_deg``, on the side from which it moved."""

    kind: ClassVar[str] = "backlash"
    targets: ClassVar[tuple[str, ...]] = AXES

    play_deg: float = 0.5

    def begins(self, world: World) -> None:
        """Sets the play."""
        self.axis(world).play_deg = self.play_deg

    def ends(self, world: World) -> None:
        """Removes the play."""
        self.axis(world).play_deg = 0.0


@dataclass
class LostHome(Fault):
    """A drive loses its reference: its angles are wrong by ``offset_deg``; its home flag is 0 unless ``admitted`` is 0."""

    kind: ClassVar[str] = "lost_home"
    targets: ClassVar[tuple[str, ...]] = AXES

    offset_deg: float = 3.0
    admitted: float = 1.0

    def begins(self, world: World) -> None:
        """Shifts the zero."""
        axis = self.axis(world)
        axis.lose_zero(self.offset_deg)
        axis.homed = self.admitted == 0.0

    def ends(self, world: World) -> None:
        """Homes the axis again."""
        axis = self.axis(world)
        axis.lose_zero(-self.offset_deg)
        axis.homed = True


@dataclass
class StuckEncoder(Fault):
    """An encoder repeats its last angle while the shaft turns."""

    kind: ClassVar[str] = "stuck_encoder"
    targets: ClassVar[tuple[str, ...]] = AXES

    def begins(self, world: World) -> None:
        """Holds the reading."""
        axis = self.axis(world)
        axis.stuck_at = axis.encoder(world.now)

    def ends(self, world: World) -> None:
        """Releases the reading."""
        self.axis(world).stuck_at = None


@dataclass
class TableStall(Fault):
    """An axis is blocked during its move; when it is released it continues to its target."""

    kind: ClassVar[str] = "table_stall"
    targets: ClassVar[tuple[str, ...]] = AXES

    def begins(self, world: World) -> None:
        """Blocks the axis."""
        self.axis(world).stall(world.now)

    def ends(self, world: World) -> None:
        """Releases the axis; its move continues."""
        self.axis(world).release(world.now, resumes=True)
