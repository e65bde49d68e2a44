# ruff: noqa: ARG002 - an effect is told everything and uses what its physics needs
"""Where physics may act that no client is told of, and what holds while it does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """What holds during a run of samples: n instants, s units.

    Parameters
    ----------
    time, since_power, vibration, humidity : (n,), s, s, g rms, % of the air around the devices
    temperature : (n, s), °C of the sensing element
    memory : (n, s, 3), what the effect's own ``slow`` gave for these instants
    """

    time: Array
    since_power: Array
    vibration: Array
    temperature: Array
    memory: Array
    humidity: Array


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
