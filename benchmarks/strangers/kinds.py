"""What a kind of world is, and the operators with memory that several of them use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from benchmarks.strangers.devices import Devices
from benchmarks.strangers.station import STEP_S, Day, Floats


@dataclass
class Record:
    """What is written down of a day; d dwells, u units. Handling errors alter it."""

    time_s: Floats  # (d, u)
    angles: Floats  # (d, u, 2), rad
    temperature: Floats  # (d, u), °C
    out: Floats  # (d, u, 3), in the unit of the output
    log: Floats  # (n, u), °C: temperatures of the history


@dataclass
class Change:
    """What a kind adds to a day at unit amplitude; all parts are proportional to the amplitude, except ``alter``.

    added : (d, u, 3), output in g; turn : (d, u, 3), rotation of the fixture that nobody records, rad
    sample_sd : (d, u, 3), noise of a sample in addition, g; units, dwells : where it is, None for all
    alter : changes the record after the measurement
    """

    added: Floats | None = None
    turn: Floats | None = None
    sample_sd: Floats | None = None
    units: tuple[int, ...] | None = None
    dwells: tuple[int, ...] | None = None
    alter: Callable[[Record], None] | None = None
    notes: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Scene:
    """What a kind may use: ``lot`` draws what stays with the devices, ``noise`` what is new every day."""

    day: Day
    devices: Devices
    lot: np.random.Generator
    noise: np.random.Generator

    @property
    def shape(self) -> tuple[int, int]:
        """Units and axes."""
        return len(self.devices.serials), 3

    @property
    def dwells(self) -> int:
        """Number of dwells of a unit."""
        return len(self.day.angles)

    def gains(self) -> Floats:
        """Sizes (u, 3) of an effect: one axis or all, about alike in the lot, each with its own sign by axis."""
        axes = np.ones(3) if self.lot.random() < 0.5 else np.eye(3)[int(self.lot.integers(3))]
        return axes * self.lot.choice([-1.0, 1.0], 3) * self.lot.uniform(0.5, 1.5, self.shape)

    def sensed(self) -> Floats:
        """Force along the axes of sensitivity (d, u, 3), g."""
        return self.devices.sensed(np.repeat(self.day.force[:, None, :], self.shape[0], axis=1))

    def one_unit(self) -> int:
        """The unit that a fault happens to."""
        return int(self.lot.integers(self.shape[0]))

    def block(self, low: float, high: float) -> tuple[int, ...]:
        """Successive dwells, a share between low and high of the run, not at its ends."""
        count = max(2, round(self.dwells * self.lot.uniform(low, high)))
        first = int(self.lot.integers(2, max(3, self.dwells - count - 2)))
        return tuple(range(first, min(first + count, self.dwells)))

    def during(self, dwells: tuple[int, ...], units: tuple[int, ...] | None = None) -> Floats:
        """1 in these dwells and units, 0 elsewhere (d, u, 1)."""
        inside = np.zeros((self.dwells, self.shape[0], 1))
        inside[np.ix_(list(dwells), list(range(self.shape[0])) if units is None else list(units))] = 1.0
        return inside


@dataclass(frozen=True)
class Kind:
    """A kind of world.

    scaled : whether its size can be asked for; catalogue : ids of docs/reference/effects.md that mean the same physics
    """

    world: str
    name: str
    change: Callable[[Scene], Change]
    needs: frozenset[str]
    scaled: bool
    catalogue: tuple[str, ...]


KINDS: dict[str, Kind] = {}


def kind(
    world: str, *needs: str, scaled: bool = True, catalogue: tuple[str, ...] = ()
) -> Callable[[Callable[[Scene], Change]], Callable[[Scene], Change]]:
    """Registers a function as a kind of world under its own name."""

    def register(change: Callable[[Scene], Change]) -> Callable[[Scene], Change]:
        name = change.__name__.strip("_")
        KINDS[name] = Kind(world, name, change, frozenset(needs), scaled, catalogue)
        return change

    return register


def relax(values: Floats, tau: float, start: Floats) -> Floats:
    """The solution z of τ·dz/dt = values − z on the grid (n, …), exact for values that are constant within a step."""
    keep = np.exp(-STEP_S / tau)
    return lfilter([1.0 - keep], [1.0, -keep], values, axis=0, zi=keep * np.asarray(start, dtype=float)[None])[0]


def play(values: Floats, half_width: Floats, start: Floats) -> Floats:
    """The play operator over values (n, …): what is dragged along once the slack of half_width is used up."""
    z, result = np.array(start, dtype=float), np.empty_like(values)
    for index, value in enumerate(values):
        z = np.clip(z, value - half_width, value + half_width)
        result[index] = z
    return result


def relays(values: Floats, up: Floats, down: Floats, weight: Floats) -> Floats:
    """A Preisach operator over values (n, m): relays (r,) that switch on above ``up`` and off below ``down``."""
    state = np.where(values[0][:, None] > (up + down) / 2.0, 1.0, -1.0)
    result = np.empty_like(values)
    for index, value in enumerate(values):
        level = value[:, None]
        state = np.where(level > up, 1.0, np.where(level < down, -1.0, state))
        result[index] = state @ weight
    return result
