"""Humidity of the air around the devices: vapour pressure of the room, and relative humidity at chamber temperature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOM_HPA = 12.5  # vapour pressure of a room at 23 °C and 45 %
UNREST = 0.12  # relative amplitude of each variation
PERIODS_S = (1500.0, 4100.0, 11000.0)  # air conditioning, doors, weather


class Moisture:
    """Vapour pressure as a function of time; through the port of the chamber it follows that of the room."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._phases = rng.uniform(0.0, 2.0 * np.pi, len(PERIODS_S))
        self._sizes = UNREST * rng.uniform(0.5, 1.0, len(PERIODS_S))

    def pressure(self, time: Array) -> Array:
        """Vapour pressure at instants (n,), hPa."""
        swings = [
            size * np.sin(2.0 * np.pi * time / period + phase)
            for size, period, phase in zip(self._sizes, PERIODS_S, self._phases, strict=True)
        ]
        return np.asarray(ROOM_HPA * (1.0 + np.sum(swings, axis=0)), dtype=np.float64)

    def relative(self, time: Array, air: Array) -> Array:
        """Relative humidity (n,), %, at air temperatures (n,), °C; at most 100 %, as the rest condenses."""
        return np.minimum(100.0 * self.pressure(time) / saturation(air), 100.0)


def saturation(air: Array) -> Array:
    """Saturation vapour pressure over water, hPa: Magnus' formula, coefficients of WMO-No. 8 (2018), annex 4.B."""
    return np.asarray(6.112 * np.exp(17.62 * air / (243.12 + air)), dtype=np.float64)
