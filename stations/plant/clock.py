"""The plant as the clock: sleeping is what lets its time pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stations.plant.world import World


class PlantClock:
    """Time of the world, in whole microseconds, so that the way a sleep is chopped up leaves no trace."""

    def __init__(self, world: World) -> None:
        self._world = world

    def now(self) -> float:
        """Seconds since the plant's power-on."""
        return self._world.now + self._world.clock_offset_s

    def sleep(self, seconds: float) -> None:
        """Lets the plant's time go on."""
        self._world.advance(max(0, round(seconds * 1e6)))
