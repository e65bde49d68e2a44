"""Temperature inside the package: stress with backlash, parts with thermal lag, self-heating."""

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
    """Package stress that follows temperature with backlash of ``width`` kelvin and ``gain`` g per kelvin."""

    width: float = 10.0
    gain: float = 20e-6
    _pin: Array | None = field(default=None, init=False)

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """Backlash state relative to the temperature, K."""
        if self._pin is None:
            self._pin = temperature.copy()
        half = self.width / 2.0
        self._pin = np.clip(self._pin, temperature - half, temperature + half)
        return np.repeat((self._pin - temperature)[:, None], 3, axis=1)

    def output(self, force: Array, block: Block) -> Array:
        """Stress of the backlash state."""
        return self.gain * block.memory


@dataclass
class ElementLag(Untouched):
    """The bias arises in a part of the package that follows the thermometer with a lag."""

    tau: float = 60.0  # s
    tempco: float = 200e-6  # g per K
    _inside: Array | None = field(default=None, init=False)

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """Temperature of the element minus that of the thermometer, K."""
        if self._inside is None:
            self._inside = temperature.copy()
        self._inside = self._inside + (temperature - self._inside) * (1.0 - math.exp(-step / self.tau))
        return np.repeat((self._inside - temperature)[:, None], 3, axis=1)

    def output(self, force: Array, block: Block) -> Array:
        """Bias of the element at its temperature minus that at the temperature of the thermometer."""
        return self.tempco * block.memory


@dataclass
class WarmUp(Untouched):
    """The device heats itself after power-on and its bias follows; without power it cools with the same time constant."""

    size: float = 500e-6  # g, bias of a cold device minus that of a warm one
    tau: float = 900.0  # s
    _cold: float = field(
        default=1.0, init=False
    )  # missing fraction of the self-heating at the last switching of the supply
    _switched: float = field(default=0.0, init=False)

    def power(self, now: float, *, on: bool) -> None:
        """Updates the missing fraction of the self-heating."""
        decay = math.exp(-(now - self._switched) / self.tau)
        self._cold = 1.0 - (1.0 - self._cold) * decay if on else self._cold * decay
        self._switched = now

    def output(self, force: Array, block: Block) -> Array:
        """Remaining bias of the warm-up."""
        remaining = self.size * self._cold * np.exp(-block.since_power / self.tau)
        return np.broadcast_to(remaining[:, None, None], force.shape)
