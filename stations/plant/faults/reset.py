"""A connection that is reset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class Reset(Wire):
    """The connection is reset in place of an answer: a switch restarts, a cable is moved."""

    kind: ClassVar[str] = "reset"

    def meddles(self) -> Meddling:
        """Reset."""
        return Meddling("reset")
