"""A memory that overflows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import UNIT, Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class FifoOverflow(Trouble):
    """The memory of a unit overflows once: samples that nobody has taken are written over."""

    kind: ClassVar[str] = "fifo_overflow"
    about: ClassVar[tuple[str, ...]] = (UNIT,)

    def begins(self, plant: Plant) -> None:
        """The reader says so; the samples are gone."""
        plant.sampler.overrun(self.unit)
