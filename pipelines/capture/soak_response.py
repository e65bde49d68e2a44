"""The measured response of a soak: overshoot of air and devices, ramp of the air, lag of the devices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

LAG_STEP_K = 1.5  # smallest temperature step that identifies a lag
RAMP_STEP_K = 5.0  # smallest temperature step that identifies the ramp
FEWEST_ROWS = 12
QUIET_K = 0.3  # smaller differences between air and device are due to place and noise


@dataclass
class Approach:
    """Temperatures of air and devices on the way to a soak's target, °C."""

    target: float
    rows: list[tuple[float, float, list[float]]] = field(default_factory=list["tuple[float, float, list[float]]"])

    def add(self, time: float, air: float, devices: Sequence[float]) -> None:
        """Adds the temperatures of one instant, s and °C."""
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
        """Overshoot of values over the target, from their first value on, K; values that are not finite are left out."""
        known = [value for value in values if math.isfinite(value)]
        if not known:
            return 0.0
        direction = math.copysign(1.0, self.target - known[0])
        return max(0.0, *(direction * (value - self.target) for value in known))

    def air_ramp(self) -> float | None:
        """Ramp of the air between 10 % and 80 % of the step, K/min; None where the step was too small."""
        air = self._air()
        if len(air) < FEWEST_ROWS or abs(self.target - air[0, 1]) < RAMP_STEP_K:
            return None
        part = (air[:, 1] - air[0, 1]) / (self.target - air[0, 1])
        begin, end = int(np.argmax(part >= 0.1)), int(np.argmax(part >= 0.8))
        if end <= begin:
            return None
        return float(abs(air[end, 1] - air[begin, 1]) / (air[end, 0] - air[begin, 0]) * 60.0)

    def lag_s(self) -> float | None:
        """Lag of the slowest device behind the air, s; None where the step was too small.

        First order: the slope of a device is its difference to the air at its place, over its lag. A straight line through slopes
        against differences gives both.
        """
        air = self._air()
        if len(air) < FEWEST_ROWS or abs(self.target - air[0, 1]) < LAG_STEP_K:
            return None
        devices = np.array([row[2] for row in self.rows if math.isfinite(row[1])], dtype=np.float64)
        lags = [lag for column in devices.T if (lag := _lag(air, column)) is not None]
        return max(lags, default=None)

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
    if used.sum() < FEWEST_ROWS // 2:
        return None
    slope = np.diff(device)[used] / step[used]
    design = np.stack((between[used], np.ones(int(used.sum()))), axis=1)
    rate = float(np.linalg.lstsq(design, slope, rcond=None)[0][0])
    return 1.0 / rate if rate > 0.0 else None
