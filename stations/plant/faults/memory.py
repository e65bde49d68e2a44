"""Faults of the memory of a unit."""

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import UNIT, Fault
from stations.plant.world import World


@dataclass
class BadBlock(Fault):
    """A word of a unit's memory no longer keeps some bits: word ``word`` of copy A (``copy`` 0) or B (1)."""

    kind: ClassVar[str] = "memory_bad_block"
    targets: ClassVar[tuple[str, ...]] = (UNIT,)

    copy: float = 0.0
    word: float = 40.0

    def begins(self, world: World) -> None:
        """Bits stay cleared."""
        world.flash[self.unit].stuck[int(self.copy), int(self.word)] = 0xFF00

    def ends(self, world: World) -> None:
        """The bits work again."""
        world.flash[self.unit].stuck.clear()


@dataclass
class PowerLostWhileWriting(Fault):
    """The supply of the devices fails for a second, ``after_s`` after the next command to program the unit's memory."""

    kind: ClassVar[str] = "memory_power_lost"
    targets: ClassVar[tuple[str, ...]] = (UNIT,)

    after_s: float = 0.45

    def begins(self, world: World) -> None:
        """Waits for the command."""
        world.flash[self.unit].lose_power_s = self.after_s


@dataclass
class WornOut(Fault):
    """The memory of a unit has ``left`` of its specified erasures left."""

    kind: ClassVar[str] = "memory_worn"
    targets: ClassVar[tuple[str, ...]] = (UNIT,)

    left: float = 0.0

    def begins(self, world: World) -> None:
        """Counts erasures up."""
        flash = world.flash[self.unit]
        flash.erases = [flash.endurance - int(self.left)] * 2
