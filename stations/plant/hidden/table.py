"""Errors of table, encoder and fixture, the same for every device or for every device in a slot; errors of the references.

The truth is independent of the fit because an error acts where it arises: it turns the angles, the vertical or the force before
a device answers, by a rotation or its second order. The fit's columns, linear in a coefficient, are not used and not imported.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from schemas.simulation import ReferenceErrors
from stations.plant.hidden.base import Array, HiddenEffect


@dataclass
class LevelError(HiddenEffect):
    """Level error of the table base."""

    about_x: float = 200e-6  # rad
    about_y: float = -100e-6

    def up(self, direction: Array) -> Array:
        x, y, z = direction
        y, z = (
            y * math.cos(self.about_x) + z * math.sin(self.about_x),
            z * math.cos(self.about_x) - y * math.sin(self.about_x),
        )
        x, z = (
            x * math.cos(self.about_y) - z * math.sin(self.about_y),
            z * math.cos(self.about_y) + x * math.sin(self.about_y),
        )
        return np.array([x, y, z])


@dataclass
class EncoderHarmonic(HiddenEffect):
    """An eccentric encoder disc: the angle error of the outer encoder is a sine over the turn."""

    size: float = 200e-6  # rad
    order: float = 1.0
    phase: float = 0.7

    def table(self, outer: Array, inner: Array) -> tuple[Array, Array]:
        return outer + self.size * np.sin(self.order * outer + self.phase), inner


@dataclass
class SlotRotation(HiddenEffect):
    """Misaligned fixture: every slot is rotated by its own small vector."""

    size: float = 1e-3  # rad
    _vector: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        self._vector = self.size * stream.standard_normal((units, 3))

    def force(self, force: Array) -> Array:
        """The force in the frame of the rotated slot, to second order."""
        first = np.cross(force, self._vector)
        return force + first + 0.5 * np.cross(first, self._vector)


REFERENCE_C = 25.0
ORDERS = (1, 2)


class StationErrors(HiddenEffect):
    """Errors of a station and its references, constant until they are recalibrated.

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
        """Reading of the thermometers at a temperature, °C."""
        return temperature + self.thermometer_offset + self.thermometer_slope * (temperature - REFERENCE_C)
