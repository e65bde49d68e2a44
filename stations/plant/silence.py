"""The devices' own watchdogs: a drive and a reader that receive no request for some time stop by themselves.

Real drives have such a communication time-out (the AZ series calls it so, and stops with an alarm); controllers of
chambers mostly have none and keep their set point. It lives in wall time, and so only in a station that is served.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from schemas.station import Devices
    from stations.plant.plant import Plant


class IdleStop:
    """Stops devices without a request for ``seconds``; the time counts from a device's first request."""

    def __init__(self, plant: Plant, devices: Devices, seconds: float) -> None:
        self._plant, self._seconds = plant, seconds
        self._stops: dict[int, Callable[[], None]] = {
            devices.outer.device_id: lambda: plant.outer.halt(plant.now),
            devices.inner.device_id: lambda: plant.inner.halt(plant.now),
            devices.reader.device_id: plant.sampler.stop,
        }
        self._asked: dict[int, float] = {}

    def look(self, now: float) -> None:
        """Looks who has been asked since the last look, at ``now`` s of the wall, and stops who has waited too long."""
        if self._seconds == 0.0:
            return
        with self._plant.lock:
            self._asked.update(dict.fromkeys(self._plant.requested & self._stops.keys(), now))
            self._plant.requested.clear()
            late = [device_id for device_id, asked in self._asked.items() if now - asked > self._seconds]
            for device_id in late:
                self._stops[device_id]()
                del self._asked[device_id]
