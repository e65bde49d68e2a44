"""Bytes that change on their way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class ByteGarbage(Wire):
    """Some bytes of an answer change on their way; Modbus TCP has no checksum of its own."""

    kind: ClassVar[str] = "byte_garbage"

    size: float = 2.0

    def meddles(self) -> Meddling:
        """Changed."""
        return Meddling("garble", size=int(self.size))
