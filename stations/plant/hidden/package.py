"""The package of a device in its environment: adhesive that yields, moisture that diffuses, a lid that leaks."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from stations.plant.hidden.base import Array, Block, HiddenEffect

KELVIN = 273.15
REFERENCE_K = 298.15
BOLTZMANN_EV_K = 8.617e-5
BAR_HPA = 1000.0
DRY_MIDDLE = 0.45  # relative humidity at which the calibration values hold
NODES = 12  # through half the thickness of the plate


@dataclass
class PackageEffect(HiddenEffect, ABC):
    """An inner state (s,) that acts on the bias by ``_bias`` g and on the scale by ``_scale``, per unit of the state."""

    breathes: ClassVar[bool] = True
    humidity: float = field(default=DRY_MIDDLE, init=False)
    pressure: float = field(default=1013.25, init=False)
    _sign: Array = field(default_factory=lambda: np.ones((1, 3)), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        self._sign = stream.choice([-1.0, 1.0], (units, 3)) * stream.uniform(0.7, 1.3, (units, 3))

    def surround(self, humidity: float, pressure: float) -> None:
        self.humidity, self.pressure = humidity / 100.0, pressure

    @abstractmethod
    def acting(self) -> tuple[float, float]:
        """Bias in g and relative scale that the state of 1 gives."""

    def output(self, force: Array, block: Block) -> Array:
        bias, scale = self.acting()
        return self._sign * block.memory * (bias + scale * force)

    @staticmethod
    def spread(state: Array) -> Array:
        """The state (s,) for the three axes."""
        return np.repeat(state[:, None], 3, axis=1)


@dataclass
class YieldingAdhesive(PackageEffect):
    """Assembly stress in the die bond, of which what exceeds the yield in a shock of cold flows and is gone for good.

    The shell follows the air before the die does: in a fast fall it shrinks round the warm die, and adds ``lag`` to the assembly
    stress. All stresses are in kelvin of that difference. A slow cycle adds a few kelvin and changes nothing; repeated shocks
    of the same size shake down to the yield.
    """

    gain: float = 20e-6  # g per kelvin that has flowed
    scale: float = 10e-6
    assembly: float = 20.0
    limit: float = 30.0
    tau: float = 60.0  # s, die behind shell
    _die: Array | None = field(default=None, init=False)
    _flowed: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def acting(self) -> tuple[float, float]:
        return self.gain, self.scale

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """Stress that has flowed, K."""
        if self._die is None:
            self._die, self._flowed = temperature.copy(), np.zeros_like(temperature)
        self._die = self._die + (temperature - self._die) * (1.0 - math.exp(-step / self.tau))
        stress = self.assembly - self._flowed + self._die - temperature
        self._flowed = self._flowed + np.maximum(0.0, stress - self.limit)
        return self.spread(self._flowed)


@dataclass
class MoistureDiffusion(PackageEffect):
    """Water that diffuses into the moulding from both faces of a plate (Fick), faster when it is warm (Arrhenius).

    The state is the mean water content over that in saturated air, less that at 45 %.
    """

    swelling: float = 3e-3  # g, from dry to saturated
    scale: float = 1e-3
    half_mm: float = 0.25
    diffusivity: float = 1e-12  # m²/s at 25 °C
    activation_eV: float = 0.45
    _content: Array | None = field(default=None, init=False)

    def acting(self) -> tuple[float, float]:
        return self.swelling, self.scale

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """Finite volumes from the face to the middle; the water in the outermost layer is that of the air half a layer away."""
        if self._content is None:
            self._content = np.full((len(temperature), NODES), self.humidity)
        kelvin = temperature + KELVIN
        d = self.diffusivity * np.exp(self.activation_eV / BOLTZMANN_EV_K * (1.0 / REFERENCE_K - 1.0 / kelvin))
        rate = (d * step / (1e-3 * self.half_mm / NODES) ** 2)[:, None]
        inwards = -np.diff(self._content, axis=1)
        entering = 2.0 * (self.humidity - self._content[:, :1])
        flow = np.hstack([entering, inwards, np.zeros((len(temperature), 1))])
        self._content = self._content - rate * np.diff(flow, axis=1)
        return self.spread(self._content.mean(axis=1) - DRY_MIDDLE)


@dataclass
class LeakyLid(PackageEffect):
    """A lid over sealed gas bends with the difference of pressure; the gas warms with the device, and leaks out through the seal.

    The state is the deflection of a plate that its own stretching stiffens: w + stiffening·w³ is the difference in bar.
    """

    deflection: float = 3e-3  # g at a difference of 1 bar
    scale: float = 1e-3
    stiffening: float = 0.2
    leak_h: float = 40.0
    _gas: Array | None = field(default=None, init=False)  # hPa that it would have at 25 °C

    def acting(self) -> tuple[float, float]:
        return self.deflection, self.scale

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """The deflection."""
        warmer = (temperature + KELVIN) / REFERENCE_K
        if self._gas is None:
            self._gas = self.pressure / warmer
        self._gas = self._gas + (self.pressure / warmer - self._gas) * (1.0 - math.exp(-step / (3600.0 * self.leak_h)))
        load = (self._gas * warmer - self.pressure) / BAR_HPA
        w = load.copy()
        for _ in range(4):
            w = w - (w + self.stiffening * w**3 - load) / (1.0 + 3.0 * self.stiffening * w**2)
        return self.spread(w)
