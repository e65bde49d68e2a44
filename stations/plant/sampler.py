"""Sampling of the reader: one clock for all slots, a ring buffer of packed samples per slot."""

import numpy as np

from stations.codec import WORDS_PER_SAMPLE, Packing, pack_samples
from stations.plant.physics import Physics

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
        packed = pack_samples(counts, self.head + self._skipped, self.packing)
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
