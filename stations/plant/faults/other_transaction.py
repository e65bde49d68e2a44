"""An answer under the wrong number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class OtherTransaction(Wire):
    """An answer arrives under a transaction id that nobody asked with."""

    kind: ClassVar[str] = "other_transaction"

    def meddles(self) -> Meddling:
        """Its number is another."""
        return Meddling("retag", size=1)
