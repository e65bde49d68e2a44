"""The clock of the plant: a sleep advances its time."""

from __future__ import annotations

from stations.plant.world import World


class PlantClock:
    """Time of the simulated world in whole microseconds, so that the division of a sleep into parts has no effect."""

    def __init__(self, world: World) -> None:
        self._world = world

    def now(self) -> float:
        """Seconds since power-on of the plant."""
        return self._world.now + self._world.clock_offset_s

    def sleep(self, seconds: float) -> None:
        """Advances the time of the plant."""
        self._world.advance(max(0, round(seconds * 1e6)))
