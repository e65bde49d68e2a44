"""Interface of the hidden effects, and the quantities at their instants."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """Quantities during a block of samples: n instants, s units.

    time, since_power, vibration, humidity : (n,), s, s, g rms, % of the air around the devices
    temperature : (n, s), °C of the sensing element
    memory : (n, s, 3), the result of ``slow`` of the effect for these instants
    """

    time: Array
    since_power: Array
    vibration: Array
    temperature: Array
    memory: Array
    humidity: Array


class HiddenEffect:
    """A hidden effect, and the base class of all: each method here does nothing. Forces and outputs in g, angles in rad, °C."""

    breathes: ClassVar[bool] = False
    """Whether the air around the devices acts on it."""

    def begin(self, units: int, stream: np.random.Generator) -> None:
        """Draws the parameters of each unit; called once."""

    def table(self, outer: Array, inner: Array) -> tuple[Array, Array]:
        """True angles of the table (n,) where the encoders read ``outer`` and ``inner``."""
        return outer, inner

    def up(self, direction: Array) -> Array:
        """Direction (3,) of the specific force at rest in the frame of the table base."""
        return direction

    def force(self, force: Array) -> Array:
        """True specific force on every unit, (n, s, 3), after table and slot."""
        return force

    def surround(self, humidity: float, pressure: float) -> None:
        """The air around the devices from now on, % and hPa; called before every ``slow`` of an effect that breathes."""

    def slow(self, temperature: Array, force: Array, step: float) -> Array:
        """Memory of the effect (s, 3) after ``step`` seconds at ``temperature`` (s,) and ``force`` (s, 3)."""
        return np.zeros_like(force)

    def power(self, now: float, *, on: bool) -> None:
        """The supply of the devices is switched at ``now`` s; it is on at the start."""

    def sprung(self, temperature: Array, pressure: float) -> tuple[Array, Array]:
        """Factors of natural frequency and damping ratio (s,) at °C (s,) and hPa, over those at 25 °C and 1013 hPa."""
        return np.ones_like(temperature), np.ones_like(temperature)

    def output(self, force: Array, block: Block) -> Array | float:
        """Addition to the outputs, (n, s, 3) or (n, 1, 1), g, under ``force`` (n, s, 3)."""
        return 0.0
