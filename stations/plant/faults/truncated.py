"""An answer that is cut off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class Truncated(Wire):
    """An answer ends too early, and the connection with it."""

    kind: ClassVar[str] = "truncated"

    size: float = 3.0

    def meddles(self) -> Meddling:
        """Cut off."""
        return Meddling("truncate", size=int(self.size))
