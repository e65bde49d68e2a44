"""An answer that comes late, but in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class Delay(Wire):
    """An answer takes ``delay_s`` of wall time, with everything behind it."""

    kind: ClassVar[str] = "delay"

    delay_s: float = 0.2

    def meddles(self) -> Meddling:
        """Held."""
        return Meddling("delay", delay_s=self.delay_s)
