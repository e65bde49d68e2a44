"""Faults of units, of the reader and its sensors, and of the computer's clock."""

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import UNIT, Fault
from stations.plant.world import World


@dataclass
class ClockJump(Fault):
    """The clock of the computer that drives the station jumps by ``step_s`` seconds."""

    kind: ClassVar[str] = "clock_jump"

    step_s: float = 30.0

    def begins(self, world: World) -> None:
        """Shifts the clock."""
        world.clock_offset_s += self.step_s


@dataclass
class Dead(Fault):
    """The outputs of a unit stay at their last count."""

    kind: ClassVar[str] = "dead"
    targets: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, world: World) -> None:
        """Holds the outputs."""
        world.physics.dead_from[self.unit] = self.order.at_s

    def ends(self, world: World) -> None:
        """Releases the outputs."""
        world.physics.dead_from[self.unit] = float("inf")


@dataclass
class DroppedSamples(Fault):
    """The reader loses ``samples``: the sample numbers show the gap unless ``numbered`` is 0; the count always does."""

    kind: ClassVar[str] = "dropped_samples"

    samples: float = 5.0
    numbered: float = 1.0

    def begins(self, world: World) -> None:
        """Drops the next samples."""
        world.sampler.lose(int(self.samples), numbered=self.numbered != 0.0)


@dataclass
class FifoOverflow(Fault):
    """The memory of a unit overflows once: samples that were not read yet are overwritten."""

    kind: ClassVar[str] = "fifo_overflow"
    targets: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, world: World) -> None:
        """Sets the overflow flag and clears the samples."""
        world.sampler.overrun(self.unit)


@dataclass
class FrozenTemperature(Fault):
    """A thermometer repeats its last reading: that of a unit, of the chamber, or all of the reader's."""

    kind: ClassVar[str] = "frozen_temperature"
    targets: ClassVar[tuple[str, ...]] = (UNIT, "chamber", "reader")

    def begins(self, world: World) -> None:
        """Holds the reading."""
        if self.order.device == "chamber":
            world.frozen_air_C = world.air_reading()
            return
        readings = world.temperature_reading()
        slots = [world.slots[self.unit]] if self.order.serial else range(len(readings))
        world.frozen_slots_C |= {slot: readings[slot] for slot in slots}

    def ends(self, world: World) -> None:
        """Releases the reading."""
        world.frozen_air_C = None
        world.frozen_slots_C.clear()


@dataclass
class SupplySag(Fault):
    """The supply of a unit, or of all, falls by the fraction ``part``; ratiometric outputs fall with it, others shift."""

    kind: ClassVar[str] = "supply_sag"
    targets: ClassVar[tuple[str, ...]] = (UNIT, "reader")

    part: float = 0.1

    def begins(self, world: World) -> None:
        """Lowers the supply."""
        world.scale_supply(self._units(world), 1.0 - self.part)

    def ends(self, world: World) -> None:
        """Restores the supply."""
        world.scale_supply(self._units(world), 1.0)

    def _units(self, world: World) -> list[int]:
        return [self.unit] if self.order.serial else list(range(len(world.slots)))


@dataclass
class SwappedSlots(Fault):
    """A unit and the next one of the lot change places: each slot has the other's serial number and samples."""

    kind: ClassVar[str] = "swapped_slots"
    targets: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, world: World) -> None:
        """Exchanges the two units."""
        other, seats = (self.unit + 1) % len(world.serials), world.seats
        seats[self.unit], seats[other] = seats[other], seats[self.unit]

    def ends(self, world: World) -> None:
        """Exchanges them again."""
        self.begins(world)
