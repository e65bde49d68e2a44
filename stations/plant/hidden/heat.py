# ruff: noqa: ARG002 - an effect is told everything and uses what its physics needs
"""Temperature inside the package: stress with play, parts that follow late, the device's own heat."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from stations.plant.hidden.base import Untouched

if TYPE_CHECKING:
    from stations.plant.hidden.base import Array, Block


@dataclass
class HysteresisPlay(Untouched):
    """Packaging stress that follows temperature with play: a pin in a slot of ``width`` kelvin, ``gain`` g per kelvin."""

    width: float = 10.0
    gain: float = 20e-6
    _pin: Array | None = field(default=None, init=False)

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """The pin's position relative to the temperature's middle, in K."""
        if self._pin is None:
            self._pin = temperature.copy()
        half = self.width / 2.0
        self._pin = np.clip(self._pin, temperature - half, temperature + half)
        return np.repeat((self._pin - temperature)[:, None], 3, axis=1)

    def output(self, force: Array, block: Block) -> Array:
        """Stress from where the pin lags."""
        return self.gain * block.memory


@dataclass
class ElementLag(Untouched):
    """The bias is made in a part of the package that follows the thermometer with a lag."""

    tau: float = 60.0  # s
    tempco: float = 200e-6  # g per K
    _inside: Array | None = field(default=None, init=False)

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """How far the element's temperature is from the thermometer's, K."""
        if self._inside is None:
            self._inside = temperature.copy()
        self._inside = self._inside + (temperature - self._inside) * (1.0 - math.exp(-step / self.tau))
        return np.repeat((self._inside - temperature)[:, None], 3, axis=1)

    def output(self, force: Array, block: Block) -> Array:
        """The bias that belongs to the element's temperature, beyond that of the thermometer's."""
        return self.tempco * block.memory


@dataclass
class WarmUp(Untouched):
    """The device heats itself after power-on and its bias goes along; without power it cools as slowly as it warmed."""

    size: float = 500e-6  # g, of a device that is cold, beside one that is warm
    tau: float = 900.0  # s
    _cold: float = field(
        default=1.0, init=False
    )  # part of the warmth that was missing when the supply was last switched
    _switched: float = field(default=0.0, init=False)

    def power(self, now: float, *, on: bool) -> None:
        """How cold the device has become, or is still."""
        kept = math.exp(-(now - self._switched) / self.tau)
        self._cold = 1.0 - (1.0 - self._cold) * kept if on else self._cold * kept
        self._switched = now

    def output(self, force: Array, block: Block) -> Array:
        """What is left of it."""
        left = self.size * self._cold * np.exp(-block.since_power / self.tau)
        return np.broadcast_to(left[:, None, None], force.shape)
