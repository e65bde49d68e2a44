"""Samples that are never made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from stations.plant.faults.base import Trouble

if TYPE_CHECKING:
    from stations.plant.plant import Plant


@dataclass
class DroppedSamples(Trouble):
    """The reader's clock loses ``samples``: in their numbers where ``numbered`` is not 0, else only in their count."""

    kind: ClassVar[str] = "dropped_samples"

    samples: float = 5.0
    numbered: float = 1.0

    def begins(self, plant: Plant) -> None:
        """They are lost."""
        plant.sampler.lose(int(self.samples), numbered=self.numbered != 0.0)
