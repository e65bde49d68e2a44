"""Test equipment in a role of a station: exciter, shock machine, centrifuge, power supply, generator of steps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from stations.clock import Clock
from stations.devices.values import Values


class Equipment(ABC):
    """Equipment in a role of a station; the adapter knows what its commands mean, and nothing of who simulates it."""

    needs: ClassVar[tuple[str, ...]] = ()

    def __init__(self, values: Values, clock: Clock) -> None:
        self.values, self.clock = values, clock
        self.name = values.name

    @abstractmethod
    def make_safe(self) -> None:
        """Leaves it at rest, disarmed: an absolute state, which may be ordered twice."""

    def stand_by(self) -> None:  # noqa: B027 - most equipment is at rest between its own records
        """Brings it to the state for records that do not use it; nothing is sent where it already has this state."""
