"""The plant as the clock: sleeping is what lets its time pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stations.plant.plant import Plant


class PlantClock:
    """Time of the plant, in whole microseconds, so that the way a sleep is chopped up leaves no trace."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant

    def now(self) -> float:
        """Seconds since the plant's power-on."""
        return self._plant.now + self._plant.clock_off_s

    def sleep(self, seconds: float) -> None:
        """Lets the plant's time go on."""
        self._plant.advance(max(0, round(seconds * 1e6)))
