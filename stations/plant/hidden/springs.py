# ruff: noqa: ARG002 - an effect is told everything and uses what its physics needs
"""Springs and suspensions: what the proof mass does under load."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from stations.plant.hidden.base import Untouched

if TYPE_CHECKING:
    from stations.plant.hidden.base import Array, Block


@dataclass
class CubicTransfer(Untouched):
    """A spring that hardens: the mass moves by x with f = x + hardening·x³, and the pick-off reads x."""

    hardening: float = 100e-6  # per g²
    spread: float = 0.3
    _unit: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Each unit's spring."""
        self._unit = self.hardening * (1.0 + self.spread * stream.standard_normal((units, 3)))

    def output(self, force: Array, block: Block) -> Array:
        """The displacement in balance, less the force: Newton steps, quick because the term is small."""
        x = force.copy()
        for _ in range(3):
            x -= (x + self._unit * x**3 - force) / (1.0 + 3.0 * self._unit * x**2)
        return x - force


@dataclass
class PendulousMass(Untouched):
    """A mass on an arm: load turns the arm by compliance·f, so that the axis looks along its neighbour a little."""

    compliance: float = 100e-6  # rad per g
    spread: float = 0.3
    _unit: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Each unit's hinge."""
        self._unit = self.compliance * (1.0 + self.spread * stream.standard_normal((units, 3)))

    def output(self, force: Array, block: Block) -> Array:
        """The force along the turned axis less that along the axis at rest; the pendulum of x swings in y, and so on."""
        across = np.roll(force, -1, axis=-1)
        angle = self._unit * force
        return force * (np.cos(angle) - 1.0) + across * np.sin(angle)


@dataclass
class Creep(Untouched):
    """Anelastic suspension: a part ``size`` of the deflection comes late, with ``tau`` seconds."""

    size: float = 200e-6  # g per g
    tau: float = 30.0
    _strain: Array | None = field(default=None, init=False)

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """The late strain, g."""
        if self._strain is None:
            self._strain = force.copy()
        self._strain = self._strain + (force - self._strain) * (1.0 - math.exp(-step / self.tau))
        return self._strain

    def output(self, force: Array, block: Block) -> Array:
        """What has not come yet is missing."""
        return -self.size * (force - block.memory)


@dataclass
class VibrationRectification(Untouched):
    """An asymmetric spring turns vibration into a steady force: coefficient · rms²."""

    coefficient: float = 2e4  # g per g²

    def output(self, force: Array, block: Block) -> Array:
        """The rectified part."""
        return np.broadcast_to((self.coefficient * block.vibration**2)[:, None, None], force.shape)
