"""Errors of the simulated station itself, drawn once from its seed: gravity, level, axes, encoders, thermometer.

Written from the mechanisms, independently of the budget that is to cover them.
"""

import math

import numpy as np

from schemas.simulation import ReferenceErrors
from stations.plant.hidden.base import Array, HiddenEffect

REFERENCE_C = 25.0
ORDERS = (1, 2)


class StationErrors(HiddenEffect):
    """What is wrong with a station and its references until they are recalibrated.

    orthogonality : rad, turn about y between the outer and the inner axis
    thermometer_offset : K; thermometer_slope : K per K from 25 °C; pose_deg : standard deviation at every move
    """

    def __init__(self, stated: ReferenceErrors, stream: np.random.Generator) -> None:
        z = stream.standard_normal(16)
        waves = stream.standard_normal((2, len(ORDERS), 2))
        self.gravity = 1e-6 * stated.gravity_ppm * float(z[0])
        self._level = 1e-6 * stated.level_urad * z[1:3]
        self.orthogonality = 1e-6 * stated.orthogonality_urad * float(z[3])
        self._offsets = 1e-6 * np.array([stated.outer_offset_urad, stated.inner_offset_urad]) * z[4:6]
        self.thermometer_offset = stated.thermometer_offset_K * float(z[6])
        self.thermometer_slope = 1e-2 * stated.thermometer_slope_percent * float(z[7])
        self._waves = 1e-6 * stated.harmonics_urad * waves  # axis, order, sine or cosine
        self.pose_deg = math.degrees(1e-6 * stated.pose_urad)

    def table(self, outer: Array, inner: Array) -> tuple[Array, Array]:
        """True angles where the encoders say these: offsets, and discs mounted off their centres."""
        return self._true(0, outer), self._true(1, inner)

    def _true(self, axis: int, angle: Array) -> Array:
        out = angle + self._offsets[axis]
        for order, (sine, cosine) in zip(ORDERS, self._waves[axis], strict=True):
            out = out + sine * np.sin(order * angle) + cosine * np.cos(order * angle)
        return out

    def up(self, direction: Array) -> Array:
        """The vertical as the tilted base sees it, with the gravity that really acts."""
        size = float(np.linalg.norm(direction)) * (1.0 + self.gravity)
        tilted = direction / np.linalg.norm(direction) + np.array([self._level[0], self._level[1], 0.0])
        return size * tilted / np.linalg.norm(tilted)

    def reading(self, temperature: Array) -> Array:
        """What the thermometers say of a temperature, °C."""
        return temperature + self.thermometer_offset + self.thermometer_slope * (temperature - REFERENCE_C)
