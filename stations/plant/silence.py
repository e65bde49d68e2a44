"""Communication time-outs of the devices: a drive or a reader without requests stops after some time.

Real drives have this function (in the AZ series "communication timeout", which stops with an alarm); most chamber controllers do
not, and keep their set point. The time is wall time, so the function exists only in a served station.
"""

from __future__ import annotations

from collections.abc import Callable

from schemas.station_devices import Devices
from stations.plant.plant import Plant


class IdleStop:
    """Stops devices without a request for ``seconds``; the time counts from the first request to a device."""

    def __init__(self, plant: Plant, devices: Devices, seconds: float) -> None:
        self._plant, self._seconds = plant, seconds
        self._stops: dict[int, Callable[[], None]] = {
            devices.outer.device_id: lambda: plant.outer.halt(plant.now),
            devices.inner.device_id: lambda: plant.inner.halt(plant.now),
            devices.reader.device_id: plant.sampler.stop,
        }
        self._last_request: dict[int, float] = {}

    def look(self, now: float) -> None:
        """Updates the time of the last request of each device at ``now`` s wall time, and stops devices after the time-out."""
        if self._seconds == 0.0:
            return
        with self._plant.lock:
            self._last_request.update(dict.fromkeys(self._plant.requested & self._stops.keys(), now))
            self._plant.requested.clear()
            late = [device_id for device_id, last in self._last_request.items() if now - last > self._seconds]
            for device_id in late:
                self._stops[device_id]()
                del self._last_request[device_id]
