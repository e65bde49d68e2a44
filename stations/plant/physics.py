"""From where the table is to what the converters say: the chain of physics for a run of instants."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stations.codec import Counts
from stations.plant.device import PlantDevices, rotate
from stations.plant.dynamics import Dynamics
from stations.plant.fixture import Fixture
from stations.plant.hidden import Block, HiddenEffect
from stations.plant.noise import UnitNoise
from stations.plant.table import Axis, turn

Array = NDArray[np.float64]

VIBRATION_HZ = 47.3
VIBRATION_ALONG = np.array([0.48, 0.36, 0.80])  # unit vector in the fixture


class Physics:
    """Table, fixture, hidden effects, response, transfer, noise and conversion in the order in which they act."""

    def __init__(
        self,
        axes: tuple[Axis, Axis],
        fixture: Fixture,
        rotations: Array,
        devices: PlantDevices,
        dynamics: Dynamics,
        noise: UnitNoise,
        hidden: Sequence[HiddenEffect],
        gravity: float,
    ) -> None:
        self._outer, self._inner = axes
        self._fixture = fixture
        self._rotations = rotations
        self.devices = devices
        self._dynamics = dynamics
        self._noise = noise
        self._hidden = list(hidden)
        self._sampled_until = 0.0
        self._up = np.array([0.0, 0.0, gravity])
        self.orthogonality = 0.0  # rad, of the table's axes
        for effect in self._hidden:
            self._up = effect.up(self._up)
        self.dead_from = np.full(len(rotations), math.inf)
        self._held = devices.counts(np.zeros((1, len(rotations), 3)))[0]
        self._on, self._on_since = True, 0.0

    def force(self, time: Array) -> Array:
        """True specific force on every unit, (n, s, 3) in g, without vibration."""
        outer, inner = np.deg2rad(self._outer.shaft(time)), np.deg2rad(self._inner.shaft(time))
        for effect in self._hidden:
            outer, inner = effect.table(outer, inner)
        force = rotate(self._rotations, turn(self._up, outer, inner, self.orthogonality)[:, None, :])
        for effect in self._hidden:
            force = effect.force(force)
        return force

    def force_at(self, time: float) -> Array:
        """True specific force at one instant, (s, 3), g."""
        return self.force(np.array([time]))[0]

    def power(self, *, on: bool, now: float) -> None:
        """The devices lose their supply, or get it again."""
        self._on = on
        if on:
            self._on_since = now
            self.devices.switched_on()
        for effect in self._hidden:
            effect.power(now, on=on)

    def begin(self, start: float, rate: float) -> None:
        """Sampling starts at ``start`` s with ``rate`` Hz."""
        self._noise.jump(start - self._sampled_until)
        self._sampled_until = start
        self._dynamics.begin(rate, self.force_at(start))

    def samples(self, time: Array, rate: float) -> Counts:
        """Counts (n, s, 3) at the next instants ``time`` (n,), s."""
        shaking = self._fixture.vibration.at(time)
        swing = math.sqrt(2.0) * shaking * np.sin(2.0 * math.pi * VIBRATION_HZ * time)
        felt = self._dynamics.respond(self.force(time) + swing[:, None, None] * VIBRATION_ALONG)
        temperature = self._fixture.temperature.at(time)
        out = self.devices.output(felt, temperature)
        humidity = self._fixture.humidity(time) if self._hidden else time
        for effect, memory in zip(self._hidden, self._fixture.memory, strict=True):
            block = Block(time, time - self._on_since, shaking, temperature, memory.at(time), humidity)
            out = out + effect.output(felt, block)
        counts = self.devices.counts(out + self._noise.sample(len(time), rate), time)
        counts = counts if self._on else np.zeros_like(counts)
        self._sampled_until = float(time[-1])
        return self._with_the_dead(counts, time)

    def _with_the_dead(self, counts: Counts, time: Array) -> Counts:
        """Outputs that have died stay at their last count."""
        for unit, since in enumerate(self.dead_from):
            first = int(np.searchsorted(time, since))
            if first > 0:
                self._held[unit] = counts[first - 1, unit]
            counts[first:, unit] = self._held[unit]
        return counts
