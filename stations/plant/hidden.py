# ruff: noqa: ARG002 - an effect is told everything and uses what its physics needs
"""Hidden effects: physics that a station or a device may have and that no client is told of.

Each is written from its mechanism, independently of the columns in ``inertial.effects``: a truth that is made of the
fit's own columns would prove nothing. A new one is a class here (or anywhere) with the methods of :class:`HiddenEffect`; what
it does not touch it inherits from :class:`Untouched`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from schemas.errors import RecipeInvalid, did_you_mean

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """What holds during a run of samples: n instants, s units.

    Parameters
    ----------
    time, since_power, vibration : (n,), s, s, g rms
    temperature : (n, s), °C of the sensing element
    memory : (n, s, 3), what the effect's own ``slow`` gave for these instants
    """

    time: Array
    since_power: Array
    vibration: Array
    temperature: Array
    memory: Array


class HiddenEffect(Protocol):
    """Where physics may act. Forces and outputs in g, angles in rad, temperatures in °C."""

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Draws what differs between the units; called once."""
        ...

    def table(self, outer: Array, inner: Array) -> tuple[Array, Array]:
        """The table's true angles (n,) where the encoders say ``outer`` and ``inner``."""
        ...

    def up(self, direction: Array) -> Array:
        """The direction (3,) of specific force at rest in the frame of the table's base."""
        ...

    def force(self, force: Array) -> Array:
        """True specific force on every unit, (n, s, 3), from what the table and slot make of it."""
        ...

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """The effect's memory (s, 3) after ``step`` seconds at ``temperature`` (s,) and ``force`` (s, 3)."""
        ...

    def power(self, now: float, *, on: bool) -> None:
        """The devices' supply is switched at ``now`` s; they have it when everything begins."""
        ...

    def output(self, force: Array, block: Block) -> Array | float:
        """What is added to the outputs, (n, s, 3), g, under ``force`` (n, s, 3)."""
        ...


class Untouched:
    """An effect that does nothing; the base of those that do one thing."""

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Nothing is drawn."""

    def table(self, outer: Array, inner: Array) -> tuple[Array, Array]:
        """The angles as they are."""
        return outer, inner

    def up(self, direction: Array) -> Array:
        """The direction as it is."""
        return direction

    def force(self, force: Array) -> Array:
        """The force as it is."""
        return force

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """No memory."""
        return np.zeros_like(force)

    def power(self, now: float, *, on: bool) -> None:
        """It goes on as it did."""

    def output(self, force: Array, block: Block) -> Array | float:
        """Nothing is added."""
        return 0.0


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
class LevelError(Untouched):
    """The table's base is tilted in the laboratory."""

    about_x: float = 200e-6  # rad
    about_y: float = -100e-6

    def up(self, direction: Array) -> Array:
        """The vertical as the base sees it."""
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
class EncoderHarmonic(Untouched):
    """A disc mounted off its centre: the outer encoder's scale is off by a wave over the turn."""

    size: float = 200e-6  # rad
    order: float = 1.0
    phase: float = 0.7

    def table(self, outer: Array, inner: Array) -> tuple[Array, Array]:
        """The shaft's angle."""
        return outer + self.size * np.sin(self.order * outer + self.phase), inner


@dataclass
class SlotRotation(Untouched):
    """The fixture has been knocked: every slot sits rotated by a small vector of its own."""

    size: float = 1e-3  # rad
    _vector: Array = field(default_factory=lambda: np.zeros(0), init=False)

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Each slot's rotation."""
        self._vector = self.size * stream.standard_normal((units, 3))

    def force(self, force: Array) -> Array:
        """The force seen from the rotated slot, to second order."""
        first = np.cross(force, self._vector)
        return force + first + 0.5 * np.cross(first, self._vector)


@dataclass
class VibrationRectification(Untouched):
    """An asymmetric spring turns vibration into a steady force: coefficient · rms²."""

    coefficient: float = 2e4  # g per g²

    def output(self, force: Array, block: Block) -> Array:
        """The rectified part."""
        return np.broadcast_to((self.coefficient * block.vibration**2)[:, None, None], force.shape)


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


@dataclass
class StressRelaxation(Untouched):
    """Stress of the assembly that lets go over barriers of every height, with power or without: times spread over decades."""

    size: float = 100e-6  # g, let go in each factor of e of time
    shortest: float = 300.0  # s
    longest: float = 3e6

    def output(self, force: Array, block: Block) -> Array:
        """What has been let go since the run began."""
        count = 1 + math.ceil(2.0 * math.log(self.longest / self.shortest))
        times = np.geomspace(self.shortest, self.longest, count)
        each = self.size * math.log(times[1] / times[0])
        gone = each * np.sum(1.0 - np.exp(-block.time[:, None] / times), axis=1)
        return np.broadcast_to(gone[:, None, None], force.shape)


@dataclass
class StepChange(Untouched):
    """A stress lets go: the bias jumps once, at ``at`` seconds on the station's clock."""

    size: float = 300e-6  # g
    at: float = 3000.0

    def output(self, force: Array, block: Block) -> Array:
        """The jump."""
        jump = np.where(block.time >= self.at, self.size, 0.0)
        return np.broadcast_to(jump[:, None, None], force.shape)


HIDDEN: Mapping[str, Callable[..., HiddenEffect]] = {
    "cubic_transfer": CubicTransfer,
    "pendulous_mass": PendulousMass,
    "hysteresis_play": HysteresisPlay,
    "element_lag": ElementLag,
    "creep": Creep,
    "level_error": LevelError,
    "encoder_harmonic": EncoderHarmonic,
    "slot_rotation": SlotRotation,
    "vibration_rectification": VibrationRectification,
    "warm_up": WarmUp,
    "stress_relaxation": StressRelaxation,
    "step_change": StepChange,
}


def hidden_effect(kind: str, figures: Mapping[str, float]) -> HiddenEffect:
    """The hidden effect of that kind with these figures; unknown kinds and figures are refused."""
    if kind not in HIDDEN:
        message = f"simulation.hidden: no effect '{kind}'; {did_you_mean(kind, HIDDEN)}"
        raise RecipeInvalid(message, key="simulation.hidden")
    make = HIDDEN[kind]
    known = [f.name for f in fields(make) if f.init] if isinstance(make, type) else list(figures)  # pyright: ignore[reportArgumentType]
    for name in figures:
        if name not in known:
            message = f"simulation.hidden: {kind} has no '{name}'; {did_you_mean(name, known)}"
            raise RecipeInvalid(message, key=f"simulation.hidden.{name}")
    return make(**figures)
