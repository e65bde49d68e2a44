"""Errors of table, encoder and fixture: the same for every device, or for every device in a slot."""

import math
from dataclasses import dataclass, field

import numpy as np

from stations.plant.hidden.base import Array, HiddenEffect


@dataclass
class LevelError(HiddenEffect):
    """Level error of the table base."""

    about_x: float = 200e-6  # rad
    about_y: float = -100e-6

    def up(self, direction: Array) -> Array:
        """The vertical in the frame of the base."""
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
        """Angles of the shafts."""
        return outer + self.size * np.sin(self.order * outer + self.phase), inner


@dataclass
class SlotRotation(HiddenEffect):
    """Misaligned fixture: every slot is rotated by its own small vector."""

    size: float = 1e-3  # rad
    _vector: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Draws the rotation of each slot."""
        self._vector = self.size * stream.standard_normal((units, 3))

    def force(self, force: Array) -> Array:
        """The force in the frame of the rotated slot, to second order."""
        first = np.cross(force, self._vector)
        return force + first + 0.5 * np.cross(first, self._vector)
