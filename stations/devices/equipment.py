"""Test equipment that speaks in lines of text: exciter, shock machine, centrifuge, power supply."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from stations.clock import Clock
    from stations.devices.commands import Commands


class Equipment(ABC):
    """Equipment in a role of a station; the adapter knows what its commands mean, and nothing of who simulates it."""

    needs: ClassVar[tuple[str, ...]] = ()

    def __init__(self, values: Commands, clock: Clock) -> None:
        self.values, self.clock = values, clock
        self.name = values.name

    @abstractmethod
    def make_safe(self) -> None:
        """Leaves it at rest, disarmed: an absolute state, which may be ordered twice."""
