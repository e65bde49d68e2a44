"""One slot of the reader: identity of its device, and the samples in its memory."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.errors import LinkLost, StationRefused, StationTimeout
from stations.clock import Clock
from stations.codec import OUTPUTS, SEQUENCE, WORDS_PER_SAMPLE, Packing, named, unpack_samples
from stations.devices.memory import UnitMemory
from stations.devices.registers import Registers
from stations.devices.teds_memory import TedsMemory

LONGEST_READ = 125  # registers in one request
FEWEST_COUNTS, MOST_COUNTS = 100, 2**31  # in a full scale; a wrong word order gives values outside
UNITS = {"volt": "V", "lsb": "LSB", "g": "g", "m_s2": "m/s^2"}
PACKINGS: dict[str, Packing] = {name: name for name in OUTPUTS}


@dataclass(frozen=True)
class Identity:
    """Identity of the device in a slot; ``lsb`` and ``full_scale`` in ``out_unit``, ``capacity`` in samples."""

    serial: str
    packing: Packing
    out_unit: str
    lsb: float
    full_scale: float
    capacity: int

    @property
    def axes(self) -> int:
        """The number of axes with an output: x, x and y, or all three."""
        return OUTPUTS[self.packing]


@dataclass(frozen=True)
class Samples:
    """Samples of a slot: first number since the start, outputs (n, m) of m axes in their unit, and whether any were lost."""

    first: int
    outputs: NDArray[np.float64]
    overflow: bool


class SamplesLost(StationRefused):
    """Sample numbers are not consecutive: samples were lost or changed in transit; the record is not valid."""


class Slot:
    """A device under test behind the reader."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self.name = registers.name
        self._identity: Identity | None = None
        self._acknowledged: int | None = None

    def memory(self, clock: Clock) -> UnitMemory:
        """The memory of the device in the slot."""
        return UnitMemory(self._registers, clock)

    def teds(self) -> TedsMemory:
        """The memory of the device for its TEDS."""
        return TedsMemory(self._registers)

    def begin(self) -> None:
        """Sampling starts again: no sample has been read."""
        self._acknowledged = 0

    def identity(self) -> Identity:
        """Identity of the device in the slot; read once."""
        if self._identity is not None:
            return self._identity
        registers, values = self._registers, self._registers.read_group("identity")
        names = ("packing", "output_unit", "lsb", "full_scale", "capacity")
        numbers = {name: registers.number_in(name, values[name]) for name in names}
        packing, unit = (named(registers.profile.register(name), numbers[name]) for name in names[:2])
        lsb, full_scale = numbers["lsb"], numbers["full_scale"]
        possible = lsb > 0.0 and FEWEST_COUNTS <= full_scale / lsb <= MOST_COUNTS
        if packing not in PACKINGS or unit not in UNITS or not possible:
            raise StationRefused(
                f"{self.name}: packing {packing}, unit {unit}, {lsb:g} per count, full scale {full_scale:g}; known names and a "
                f"full scale of {FEWEST_COUNTS} to {MOST_COUNTS} counts are needed; check the reader and its word order"
            )
        capacity = int(numbers["capacity"])
        serial = str(values["serial"])
        self._identity = made = Identity(serial, PACKINGS[packing], UNITS[unit], lsb, full_scale, capacity)
        return made

    def holds(self, serial: str) -> bool:
        """Whether the slot holds this unit now; read again at each call."""
        return self._registers.text("serial") == serial

    def take(self) -> Samples:
        """All samples since the last call; samples that the ring has lost are flagged and never filled in."""
        identity = self.identity()
        head, tail, overflow = self._progress()
        if tail > head or (self._acknowledged is not None and tail != self._acknowledged):
            expected = f"{self._acknowledged}" if self._acknowledged is not None else f"at most {head}"
            raise StationRefused(
                f"{self.name}: reports {tail} of {head} samples as read, {expected} is needed; restart the reader"
            )
        first = max(tail, head - identity.capacity)
        counts = self._window(first, head, identity)
        if head > tail:
            self._acknowledge(head)
        return Samples(first, counts * identity.lsb, overflow or first > tail)

    def _progress(self) -> tuple[int, int, bool]:
        """Number of samples made, number acknowledged as read, and whether any were lost."""
        registers, values = self._registers, self._registers.read_group("progress")
        head, tail = (int(registers.number_in(name, values[name])) for name in ("head", "tail"))
        return head, tail, registers.flags_in("flags", values["flags"])["overflow"]

    def _acknowledge(self, head: int) -> None:
        """Acknowledges the samples before ``head``; after a lost answer the register is read, and written again if it differs."""
        try:
            self._registers.write("tail", head)
        except (StationTimeout, LinkLost):
            if self._progress()[1] != head:
                self._registers.write("tail", head)
        if self._acknowledged is not None:
            self._acknowledged = head

    def _window(self, first: int, head: int, identity: Identity) -> NDArray[np.float64]:
        """Counts (n, m) of the samples numbered ``first`` to ``head`` − 1; gaps raise :class:`SamplesLost`."""
        fifo = self._registers.profile.fifo
        if fifo is None:
            raise StationRefused(
                f"{self.name}: profile {self._registers.profile.name} has no fifo, a slot needs one; add it to the profile"
            )
        width = WORDS_PER_SAMPLE[identity.packing]
        words: list[int] = []
        at = first
        while at < head:
            offset = at % identity.capacity
            n = min(LONGEST_READ // width, head - at, identity.capacity - offset)
            words += self._registers.words(fifo.address + offset * width, n * width, "samples")
            at += n
        counts, numbers = unpack_samples(np.array(words, dtype=np.uint16), identity.packing)
        wrong = np.flatnonzero(numbers != np.arange(first, head) % SEQUENCE[identity.packing])
        if len(wrong):
            raise SamplesLost(
                f"{self.name}: sample {first + int(wrong[0])} is out of sequence, the next number is needed; check the reader"
            )
        return counts.astype(np.float64)
