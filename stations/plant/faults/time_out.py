"""An answer that is lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class TimeOut(Wire):
    """The answer to a request is lost on its way: the device has acted, and nobody knows."""

    kind: ClassVar[str] = "time_out"

    def meddles(self) -> Meddling:
        """Lost."""
        return Meddling("drop")
