"""An answer that comes after the next question."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.proxy import Meddling
from stations.plant.faults.wire import Wire


@dataclass
class LateReply(Wire):
    """An answer is held back until the next one comes, and arrives in front of it under its own, older transaction id."""

    kind: ClassVar[str] = "late_reply"

    def meddles(self) -> Meddling:
        """Held back."""
        return Meddling("late")
