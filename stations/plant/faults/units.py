"""A clock that jumps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import UNIT, Fault

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class ClockJump(Fault):
    """The clock of the computer that drives the station jumps by ``step_s`` seconds."""

    kind: ClassVar[str] = "clock_jump"

    step_s: float = 30.0

    def begins(self, plant: Plant) -> None:
        """It jumps."""
        plant.clock_off_s += self.step_s


@dataclass
class Dead(Fault):
    """The outputs of a unit stay at their last count."""

    kind: ClassVar[str] = "dead"
    about: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, plant: Plant) -> None:
        """They stay."""
        plant.physics.dead_from[self.unit] = self.fault.at_s

    def ends(self, plant: Plant) -> None:
        """They live."""
        plant.physics.dead_from[self.unit] = float("inf")


@dataclass
class DroppedSamples(Fault):
    """The reader's clock loses ``samples``: in their numbers where ``numbered`` is not 0, else only in their count."""

    kind: ClassVar[str] = "dropped_samples"

    samples: float = 5.0
    numbered: float = 1.0

    def begins(self, plant: Plant) -> None:
        """They are lost."""
        plant.sampler.lose(int(self.samples), numbered=self.numbered != 0.0)


@dataclass
class FifoOverflow(Fault):
    """The memory of a unit overflows once: samples that nobody has taken are written over."""

    kind: ClassVar[str] = "fifo_overflow"
    about: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, plant: Plant) -> None:
        """The reader says so; the samples are gone."""
        plant.sampler.overrun(self.unit)


@dataclass
class FrozenTemperature(Fault):
    """A thermometer keeps saying what it said: that of a unit, of the chamber, or all of the reader's."""

    kind: ClassVar[str] = "frozen_temperature"
    about: ClassVar[tuple[str, ...]] = (UNIT, "chamber", "reader")

    def begins(self, plant: Plant) -> None:
        """It freezes."""
        if self.fault.device == "chamber":
            plant.frozen_air = plant.air_reading()
            return
        told = plant.temperature_reading()
        meant = [plant.slots[self.unit]] if self.fault.serial else range(len(told))
        plant.frozen |= {slot: told[slot] for slot in meant}

    def ends(self, plant: Plant) -> None:
        """It thaws."""
        plant.frozen_air = None
        plant.frozen.clear()


@dataclass
class SupplySag(Fault):
    """The supply of a unit, or of all, falls by the part ``part``; outputs that follow it fall with it, others shift."""

    kind: ClassVar[str] = "supply_sag"
    about: ClassVar[tuple[str, ...]] = (UNIT, "reader")

    part: float = 0.1

    def begins(self, plant: Plant) -> None:
        """Down."""
        plant.sag(self._meant(plant), 1.0 - self.part)

    def ends(self, plant: Plant) -> None:
        """Up."""
        plant.sag(self._meant(plant), 1.0)

    def _meant(self, plant: Plant) -> list[int]:
        return [self.unit] if self.fault.serial else list(range(len(plant.slots)))


@dataclass
class SwappedSlots(Fault):
    """A unit and the next one of the lot change places: each slot has the other's serial number and samples."""

    kind: ClassVar[str] = "swapped_slots"
    about: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, plant: Plant) -> None:
        """They change places."""
        other, seats = (self.unit + 1) % len(plant.serials), plant.seats
        seats[self.unit], seats[other] = seats[other], seats[self.unit]

    def ends(self, plant: Plant) -> None:
        """They change back."""
        self.begins(plant)
