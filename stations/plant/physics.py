"""From where the table is to what the converters say, and the reader that samples it."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stations.codec import OUTPUTS, WORDS_PER_SAMPLE, Counts, Packing, pack_samples
from stations.plant.device import PlantDevices, rotate
from stations.plant.dynamics import Dynamics
from stations.plant.fixture import Fixture
from stations.plant.hidden import Block, HiddenEffect
from stations.plant.noise import UnitNoise
from stations.plant.table import turn
from stations.plant.turning import TurningForce

Array = NDArray[np.float64]

VIBRATION_HZ = 47.3
VIBRATION_ALONG = np.array([0.48, 0.36, 0.80])  # unit vector in the fixture


class Physics:
    """Table, fixture, hidden effects, response, transfer, noise and conversion in the order in which they act."""

    def __init__(
        self,
        turning: TurningForce,
        fixture: Fixture,
        rotations: Array,
        devices: PlantDevices,
        dynamics: Dynamics,
        noise: UnitNoise,
        hidden: Sequence[HiddenEffect],
        gravity: float,
    ) -> None:
        self._outer, self._inner = turning.outer, turning.inner
        self._fixture = fixture
        self._rotations = rotations
        self.devices = devices
        self._dynamics = dynamics
        self._noise = noise
        self._hidden = list(hidden)
        self._sampled_until = 0.0
        self._turning = turning
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
        moved = self._turning.force(time, self._up)
        moved = rotate(self._rotations, moved) if isinstance(moved, np.ndarray) else moved
        felt = self._dynamics.respond(self.force(time) + moved + swing[:, None, None] * VIBRATION_ALONG)
        temperature = self._fixture.temperature.at(time)
        out = self.devices.output(felt, temperature)
        humidity = self._fixture.humidity(time) if self._hidden else time
        for effect, memory in zip(self._hidden, self._fixture.memory, strict=True):
            block = Block(time, time - self._on_since, shaking, temperature, memory.at(time), humidity)
            out = out + effect.output(felt, block)
        counts = self.devices.counts(out + self._noise.sample(len(time), rate, temperature), time)
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


CHUNK = 1024


class Sampler:
    """Ring buffers of ``registers`` words, filled as the time of the plant advances."""

    def __init__(self, source: Physics, units: int, packing: Packing, registers: int) -> None:
        self._source = source
        self.packing: Packing = packing
        self._words = WORDS_PER_SAMPLE[packing]
        self.capacity = registers // self._words
        self._ring = np.zeros((units, self.capacity, self._words), dtype=np.uint16)
        self.running = False
        self.millihertz = 100_000
        self._start_us = 0
        self.head = 0
        self.tail = [0] * units
        self.overflow = [False] * units
        self._lost = 0
        self._skipped = 0

    def start(self, now_us: int) -> None:
        """Starts again: counters at zero, flags cleared."""
        self.running, self._start_us, self.head = True, now_us, 0
        self.tail = [0] * len(self.tail)
        self.overflow = [False] * len(self.overflow)
        self._lost = self._skipped = 0
        self._source.begin(now_us * 1e-6, self.rate)

    def stop(self) -> None:
        """Stops; the samples stay in the ring buffers."""
        self.running = False

    @property
    def rate(self) -> float:
        """Samples per second, Hz."""
        return self.millihertz * 1e-3

    def advance(self, now_us: int) -> None:
        """Takes every sample that is due at ``now_us``."""
        if not self.running:
            return
        due = (now_us - self._start_us) * self.millihertz // 10**9 - self._lost
        while self.head < due:
            self._fill(min(CHUNK, due - self.head))
        for unit, tail in enumerate(self.tail):
            if self.head - tail > self.capacity:
                self.overflow[unit] = True

    def _fill(self, n: int) -> None:
        number = np.arange(self.head + 1, self.head + n + 1)
        counts = self._source.samples(self._start_us * 1e-6 + (number + self._lost) / self.rate, self.rate)
        packed = pack_samples(counts[..., : OUTPUTS[self.packing]], self.head + self._skipped, self.packing)
        self._ring[:, (number - 1) % self.capacity] = np.swapaxes(packed, 0, 1)
        self.head += n

    def overrun(self, unit: int) -> None:
        """Overwrites the ring buffer of a unit before it was read: its oldest samples are lost, and the overflow flag is set."""
        if self.running:
            self.overflow[unit] = True
            self._ring[unit] = 0

    def lose(self, samples: int, *, numbered: bool) -> None:
        """Loses the next samples: the sample numbers show the gap where ``numbered``, else only the count does."""
        if self.running:
            self._lost += samples
            self._skipped += samples if numbered else 0

    def words(self, unit: int, first: int, count: int) -> list[int]:
        """``count`` words of the ring buffer of a unit from word ``first`` on."""
        flat = self._ring[unit].reshape(-1)
        part: list[int] = flat[first : first + count].tolist()
        return part + [0] * (count - len(part))
