"""A connection of which one end is gone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class HalfOpen(Wire):
    """The connection stays open and swallows everything: the device lost its power without a word."""

    kind: ClassVar[str] = "half_open"

    def meddles(self) -> Meddling:
        """Swallowed."""
        return Meddling("half_open")
