"""Inside the device: springs and suspensions under load, heat, moisture in the package, relaxation of stress."""

import math
from dataclasses import dataclass, field

import numpy as np

from stations.plant.hidden.base import Array, Block, HiddenEffect

MIDDLE_PCT = 45.0
SITES = 0.35  # fraction of the uptake that is bound at sites and saturates first


@dataclass
class CubicTransfer(HiddenEffect):
    """A hardening spring: the mass moves by x with f = x + hardening·x³, and the pick-off reads x."""

    hardening: float = 100e-6  # per g²
    spread: float = 0.3  # over the units
    _unit: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        self._unit = self.hardening * (1.0 + self.spread * stream.standard_normal((units, 3)))

    def output(self, force: Array, block: Block) -> Array:
        """Equilibrium displacement minus force, by Newton steps, which converge fast for a small term."""
        x = force.copy()
        for _ in range(3):
            x -= (x + self._unit * x**3 - force) / (1.0 + 3.0 * self._unit * x**2)
        return x - force


@dataclass
class PendulousMass(HiddenEffect):
    """A pendulous mass: load turns the arm by compliance·f, so that the axis becomes slightly sensitive to its neighbour."""

    compliance: float = 100e-6  # rad per g
    spread: float = 0.3  # over the units
    _unit: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        self._unit = self.compliance * (1.0 + self.spread * stream.standard_normal((units, 3)))

    def output(self, force: Array, block: Block) -> Array:
        """Force along the turned axis minus that along the axis at rest; the arm of x turns towards y, and so on."""
        angle = self._unit * force
        return force * (np.cos(angle) - 1.0) + np.roll(force, -1, axis=-1) * np.sin(angle)


@dataclass
class Creep(HiddenEffect):
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
class VibrationRectification(HiddenEffect):
    """An asymmetric spring rectifies vibration into a constant force: coefficient · rms²."""

    coefficient: float = 2e4  # g per g²

    def output(self, force: Array, block: Block) -> Array:
        return (self.coefficient * block.vibration**2)[:, None, None]


@dataclass
class HysteresisPlay(HiddenEffect):
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
        return self.gain * block.memory


@dataclass
class ElementLag(HiddenEffect):
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
        return self.tempco * block.memory


@dataclass
class WarmUp(HiddenEffect):
    """The device heats itself after power-on and its bias follows; without power it cools with the same time constant."""

    size: float = 500e-6  # g, bias of a cold device minus that of a warm one
    tau: float = 900.0  # s
    _cold: float = field(default=1.0, init=False)  # missing fraction of the self-heating when the supply was switched
    _switched: float = field(default=0.0, init=False)

    def power(self, now: float, *, on: bool) -> None:
        decay = math.exp(-(now - self._switched) / self.tau)
        self._cold = 1.0 - (1.0 - self._cold) * decay if on else self._cold * decay
        self._switched = now

    def output(self, force: Array, block: Block) -> Array:
        return (self.size * self._cold * np.exp(-block.since_power / self.tau))[:, None, None]


@dataclass
class MoistureSwelling(HiddenEffect):
    """Adhesive in equilibrium with the air: ``swelling`` g of bias from dry to saturated, by dissolved and by bound water.

    Dual sorption: dissolved water is proportional to humidity (Henry), bound water fills sites (Langmuir). The sensitivity
    of each axis differs from device to device.
    """

    swelling: float = 2e-3
    _sensitivity: Array = field(default_factory=lambda: np.ones((1, 3)), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        self._sensitivity = stream.choice([-1.0, 1.0], (units, 3)) * stream.uniform(0.6, 1.4, (units, 3))

    def output(self, force: Array, block: Block) -> Array:
        swollen = _uptake(block.humidity / 100.0) - _uptake(np.array(MIDDLE_PCT / 100.0))
        return self.swelling * swollen[:, None, None] * self._sensitivity


def _uptake(humidity: Array) -> Array:
    """Absorbed water relative to saturation, at a relative humidity from 0 to 1."""
    bound = humidity / (humidity + 0.5) * 1.5
    return np.asarray((1.0 - SITES) * humidity + SITES * bound, dtype=np.float64)


@dataclass
class StressRelaxation(HiddenEffect):
    """Relaxation of assembly stress, with power or without: time constants spread over decades."""

    size: float = 100e-6  # g, relaxed in each factor e of time
    shortest: float = 300.0  # s
    longest: float = 3e6

    def output(self, force: Array, block: Block) -> Array:
        count = 1 + math.ceil(2.0 * math.log(self.longest / self.shortest))
        times = np.geomspace(self.shortest, self.longest, count)
        each = self.size * math.log(times[1] / times[0])
        return (each * np.sum(1.0 - np.exp(-block.time[:, None] / times), axis=1))[:, None, None]


@dataclass
class StepChange(HiddenEffect):
    """Sudden relaxation: the bias jumps once, at ``at`` seconds on the clock of the station."""

    size: float = 300e-6  # g
    at: float = 3000.0

    def output(self, force: Array, block: Block) -> Array:
        return np.where(block.time >= self.at, self.size, 0.0)[:, None, None]
