"""What a device feels besides gravity because the table turns: its own acceleration on a circle, and the axes' wobble."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from schemas.simulation import Turning
from schemas.units import STANDARD_GRAVITY_M_S2
from stations.plant.table import Axis

Array = NDArray[np.float64]

SLOTS_ON_CIRCLE = 8
HEIGHT_M = 0.015  # of the devices above the outer axis
NEAR_S = 2e-3  # of the positions before and after, whose second difference is the acceleration


def places(turning: Turning, slots: Sequence[int]) -> Array:
    """Positions of the proof masses in the fixture, (s, 3), m from the crossing of the axes: slots on a circle."""
    around = 2.0 * math.pi * np.asarray(slots, dtype=np.float64) / SLOTS_ON_CIRCLE
    radius = 1e-3 * turning.radius_mm
    height = np.full_like(around, HEIGHT_M if radius > 0.0 else 0.0)
    return np.stack([radius * np.cos(around), radius * np.sin(around), height], axis=-1)


class TurningForce:
    """The force of a table whose axes turn, beyond that of the same angles at rest."""

    def __init__(self, outer: Axis, inner: Axis, turning: Turning, slots: Sequence[int]) -> None:
        self.outer, self.inner = outer, inner
        self._places = places(turning, slots)
        self._wobble = 1e-6 * turning.wobble_urad
        for axis in (outer, inner):
            axis.ripple = ((turning.cogging_per_turn, turning.cogging_deg), (1, turning.unbalance_deg))
            axis.late_s = (1e-3 * turning.latency_ms, 1e-3 * turning.jitter_ms)

    def force(self, time: Array, up: Array) -> Array | float:
        """Specific force by turning, in the fixture, (n, s, 3), g, at instants (n,), s; ``up`` (3,), g; 0 at rest."""
        if not (self.outer.turns(time) or self.inner.turns(time)):
            return 0.0
        before, at, after = (self._where(time + step) for step in (-NEAR_S, 0.0, NEAR_S))
        acceleration = (before - 2.0 * at + after) / (NEAR_S**2 * STANDARD_GRAVITY_M_S2)
        felt = acceleration + self._leaning(time, up)[:, None, :]
        return _back(felt, *(a[:, None] for a in self._angles(time)))

    def _angles(self, time: Array) -> tuple[Array, Array]:
        return np.deg2rad(self.outer.shaft(time)), np.deg2rad(self.inner.shaft(time))

    def _where(self, time: Array) -> Array:
        """Places (n, s, 3) in the laboratory, m: first turned about z by the inner axis, then about x by the outer one."""
        outer, inner = (a[:, None] for a in self._angles(time))
        x, y, z = self._places.T
        x, y = np.cos(inner) * x - np.sin(inner) * y, np.sin(inner) * x + np.cos(inner) * y
        return np.stack([x, np.cos(outer) * y - np.sin(outer) * z, np.sin(outer) * y + np.cos(outer) * z], axis=-1)

    def _leaning(self, time: Array, up: Array) -> Array:
        """Change (n, 3) of the vertical, g in the laboratory, by the lean of the turning axis, which goes round twice."""
        outer, inner = self._angles(time)
        zero = np.zeros_like(time)
        size = self._wobble * self.outer.move.share(time)
        lean = np.stack([zero, size * np.cos(2.0 * outer), size * np.sin(2.0 * outer)], axis=-1)
        size = self._wobble * self.inner.move.share(time)
        a, b = size * np.cos(2.0 * inner), size * np.sin(2.0 * inner)
        lean += np.stack([a, np.cos(outer) * b, np.sin(outer) * b], axis=-1)
        return np.cross(lean, up)


def _back(vector: Array, outer: Array, inner: Array) -> Array:
    """Vectors (n, s, 3) of the laboratory in the fixture."""
    x, y, z = np.moveaxis(vector, -1, 0)
    y, z = np.cos(outer) * y + np.sin(outer) * z, np.cos(outer) * z - np.sin(outer) * y
    return np.stack([np.cos(inner) * x + np.sin(inner) * y, np.cos(inner) * y - np.sin(inner) * x, z], axis=-1)
