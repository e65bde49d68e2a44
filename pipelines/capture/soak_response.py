"""A soak as it went: how far air and devices went beyond the target, how fast the air ramps, how slowly the devices follow."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

LEAST_WAY_K = 1.5  # a shorter way of the air teaches nothing of lags
RAMP_WAY_K = 5.0  # nor of the ramp
FEWEST_LOOKS = 12
QUIET_K = 0.3  # air and device closer than that differ by their places and their noise


@dataclass
class Approach:
    """How air and devices come to a soak's target."""

    target: float
    rows: list[tuple[float, float, list[float]]] = field(default_factory=list["tuple[float, float, list[float]]"])

    def look(self, time: float, air: float, devices: Sequence[float]) -> None:
        """Notes the temperatures of one instant, s and °C."""
        self.rows.append((time, air, list(devices)))

    def figures(self) -> dict[str, float]:
        """Overshoot of air and devices for the journal, K."""
        if not self.rows:
            return {"air_overshoot_K": 0.0, "device_overshoot_K": 0.0}
        columns = list(zip(*(row[2] for row in self.rows), strict=True))
        devices = max((self._beyond(column) for column in columns), default=0.0)
        return {
            "air_overshoot_K": round(self._beyond([row[1] for row in self.rows]), 4),
            "device_overshoot_K": round(devices, 4),
        }

    def _beyond(self, values: Sequence[float]) -> float:
        """How far values went beyond the target, seen from where they began; those that are not known do not count."""
        known = [value for value in values if math.isfinite(value)]
        if not known:
            return 0.0
        direction = math.copysign(1.0, self.target - known[0])
        return max(0.0, *(direction * (value - self.target) for value in known))

    def air_ramp(self) -> float | None:
        """The air's ramp over the middle of its way, K/min; None where the way was short."""
        air = self._air()
        if len(air) < FEWEST_LOOKS or abs(self.target - air[0, 1]) < RAMP_WAY_K:
            return None
        way = (air[:, 1] - air[0, 1]) / (self.target - air[0, 1])
        begin, end = int(np.argmax(way >= 0.1)), int(np.argmax(way >= 0.8))
        if end <= begin:
            return None
        return float(abs(air[end, 1] - air[begin, 1]) / (air[end, 0] - air[begin, 0]) * 60.0)

    def lag_s(self) -> float | None:
        """Seconds by which the slowest device follows the air; None where the way was too short to tell.

        Of first order: a device's slope is its distance from the air of its place, over its lag. Both follow from a straight line
        through slopes against distances.
        """
        air = self._air()
        if len(air) < FEWEST_LOOKS or abs(self.target - air[0, 1]) < LEAST_WAY_K:
            return None
        devices = np.array([row[2] for row in self.rows if math.isfinite(row[1])], dtype=np.float64)
        found = [lag for column in devices.T if (lag := _lag(air, column)) is not None]
        return max(found, default=None)

    def _air(self) -> NDArray[np.float64]:
        """Time and temperature of the air, (n, 2)."""
        return np.array([(time, air) for time, air, _ in self.rows if math.isfinite(air)], dtype=np.float64).reshape(
            -1, 2
        )


def _lag(air: NDArray[np.float64], device: NDArray[np.float64]) -> float | None:
    """Lag of one device, s, from air (n, 2) in s and °C and the device (n,) in °C."""
    step = np.diff(air[:, 0])
    distance = air[:, 1] - device
    between = (distance[1:] + distance[:-1]) / 2.0
    used = (step > 0.0) & np.isfinite(between) & (np.abs(between) > QUIET_K)
    if used.sum() < FEWEST_LOOKS // 2:
        return None
    slope = np.diff(device)[used] / step[used]
    design = np.stack((between[used], np.ones(int(used.sum()))), axis=1)
    rate = float(np.linalg.lstsq(design, slope, rcond=None)[0][0])
    return 1.0 / rate if rate > 0.0 else None
