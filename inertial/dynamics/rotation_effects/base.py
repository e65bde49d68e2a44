"""Base class of the effects on a rotation, and the columns of effects that have one coefficient an axis."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from inertial.arrays import Array
from inertial.dynamics.effect_modules import DynamicEffect
from inertial.dynamics.rotations import Nodes
from inertial.frames import to_fixture


class RotationEffect(DynamicEffect, ABC):
    """Terms of the outputs, with coefficients in ``unit``, times ``factor`` as shown. Every module of this package defines one.

    of_table : whether the table has it, and all axes and units show the same; else each axis has its own coefficient
    """

    unit: ClassVar[str]
    factor: ClassVar[float] = 1e6
    of_table: ClassVar[bool] = False

    @abstractmethod
    def columns(self, at: Nodes) -> Array:
        """Terms in g for coefficients of 1: (3, n, 3) with one an axis; of the table (3, n, 3, m), all three axes of m terms."""


def about(at: Nodes, shift: Array) -> Array:
    """Terms (3, n, 3, m) of errors (3, n, m) in rad of the turning angle, apart for outer and inner axis: (3, n, 3, 2m)."""
    about_inner = at.points.inner_turns[:, None] > 0
    each = np.concatenate([np.where(about_inner, 0.0, shift), np.where(about_inner, shift, 0.0)], axis=-1)
    return at.slope[..., :, None] * each[..., None, :]


def of_lab(at: Nodes, vector: tuple[float, float, float]) -> Array:
    """A constant vector (3,) of the laboratory in the fixture, (3, n, 3)."""
    return to_fixture(np.array(vector), at.outer, at.inner)


def waves(at: Nodes, order: int) -> Array:
    """Cosine and sine (3, n, 2) of the turning angle times ``order``, where the table turns or stands."""
    return np.stack([np.cos(order * at.angle), np.sin(order * at.angle)], axis=-1)


def elapsed(at: Nodes) -> Array:
    """Time (n,) from the first to the last point, −½ to ½."""
    time = at.points.time
    return (time - time[0]) / np.ptp(time) - 0.5


def between_axes(at: Nodes) -> Array:
    """Change (3, n, 3) of the force, g/rad, by a turn about y between outer and inner axis."""
    of_outer = to_fixture(np.array([0.0, 0.0, 1.0]), at.outer, np.zeros_like(at.inner))
    turned = np.stack([-of_outer[..., 2], np.zeros_like(at.inner), of_outer[..., 0]], axis=-1)
    return to_fixture(turned, np.zeros_like(at.outer), at.inner)


def leaning(at: Nodes, order: int) -> Array:
    """Change (3, n, 3, 4) of the force, g/rad, by an axis that leans by waves of the angle, cosine and sine, outer and inner.

    A lean of the outer axis, which lies level, moves the vertical along it; that of the inner one across the outer axis too.
    """
    along_outer = of_lab(at, (1.0, 0.0, 0.0))
    along_inner = np.sin(at.outer)[..., None] * np.array([0.0, 0.0, 1.0])
    about_inner = at.points.inner_turns[:, None] > 0
    wave = waves(at, order) * at.points.turning[:, None]
    outer, inner = (
        vector[..., :, None] * np.where(keep, wave, 0.0)[..., None, :]
        for vector, keep in ((along_outer, ~about_inner), (along_inner, about_inner))
    )
    return np.concatenate([outer, inner], axis=-1)
