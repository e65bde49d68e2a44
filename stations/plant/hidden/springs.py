"""Springs and suspensions: motion of the proof mass under load."""

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
    """A hardening spring: the mass moves by x with f = x + hardening·x³, and the pick-off reads x."""

    hardening: float = 100e-6  # per g²
    spread: float = 0.3
    _unit: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Draws the spring of each unit."""
        self._unit = self.hardening * (1.0 + self.spread * stream.standard_normal((units, 3)))

    def output(self, force: Array, block: Block) -> Array:
        """Equilibrium displacement minus force, by Newton steps, which converge fast for a small term."""
        x = force.copy()
        for _ in range(3):
            x -= (x + self._unit * x**3 - force) / (1.0 + 3.0 * self._unit * x**2)
        return x - force


@dataclass
class PendulousMass(Untouched):
    """A pendulous mass: load turns the arm by compliance·f, so that the axis becomes slightly sensitive to its neighbour."""

    compliance: float = 100e-6  # rad per g
    spread: float = 0.3
    _unit: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Draws the hinge of each unit."""
        self._unit = self.compliance * (1.0 + self.spread * stream.standard_normal((units, 3)))

    def output(self, force: Array, block: Block) -> Array:
        """Force along the turned axis minus that along the axis at rest; the arm of x turns towards y, and so on."""
        across = np.roll(force, -1, axis=-1)
        angle = self._unit * force
        return force * (np.cos(angle) - 1.0) + across * np.sin(angle)


@dataclass
class Creep(Untouched):
    """Anelastic suspension: the fraction ``size`` of the deflection follows with the time constant ``tau``."""

    size: float = 200e-6  # g per g
    tau: float = 30.0
    _strain: Array | None = field(default=None, init=False)

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """The delayed strain, g."""
        if self._strain is None:
            self._strain = force.copy()
        self._strain = self._strain + (force - self._strain) * (1.0 - math.exp(-step / self.tau))
        return self._strain

    def output(self, force: Array, block: Block) -> Array:
        """The part of the deflection that is still missing, negative."""
        return -self.size * (force - block.memory)


@dataclass
class VibrationRectification(Untouched):
    """An asymmetric spring rectifies vibration into a constant force: coefficient · rms²."""

    coefficient: float = 2e4  # g per g²

    def output(self, force: Array, block: Block) -> Array:
        """The rectified vibration."""
        return np.broadcast_to((self.coefficient * block.vibration**2)[:, None, None], force.shape)
