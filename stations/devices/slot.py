"""One slot of the reader: who sits there, and the samples in its memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schemas.errors import LinkLost, StationRefused, StationTimeout
from stations.codec import SEQUENCE, WORDS_PER_SAMPLE, Packing, named, unpack_samples

if TYPE_CHECKING:
    from stations.codec import Value
    from stations.devices.registers import Registers

LONGEST_READ = 125  # registers in one request
FEWEST_COUNTS, MOST_COUNTS = 100, 2**31  # of a full scale; words in the wrong order give anything
UNITS = {"volt": "V", "lsb": "LSB", "g": "g", "m_s2": "m/s^2"}
PACKINGS: dict[str, Packing] = {"int20x3": "int20x3", "int24x3": "int24x3"}


@dataclass(frozen=True)
class Identity:
    """What a slot says of the device in it; ``lsb`` and ``full_scale`` in ``out_unit``, ``capacity`` in samples."""

    serial: str
    packing: Packing
    out_unit: str
    lsb: float
    full_scale: float
    capacity: int


@dataclass(frozen=True)
class Samples:
    """Samples taken from a slot: first number since the start, outputs (n, 3) in the output's unit, whether some were lost."""

    first: int
    outputs: NDArray[np.float64]
    overflow: bool


class SamplesLost(StationRefused):
    """Samples that do not follow each other: some were lost, or changed on their way; the record is of no use."""


class Slot:
    """A device under test behind the reader."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self.name = registers.name
        self._identity: Identity | None = None
        self._taken: int | None = None

    def begin(self) -> None:
        """Sampling starts afresh: nothing has been taken."""
        self._taken = 0

    def identity(self) -> Identity:
        """What the slot says of the device in it; asked once."""
        if self._identity is None:
            self._identity = self._ask()
        return self._identity

    def _ask(self) -> Identity:
        values = self._registers.read_group("identity")
        packing = self._named("packing", values["packing"])
        unit = self._named("output_unit", values["output_unit"])
        lsb, full_scale = _number(values["lsb"]), _number(values["full_scale"])
        possible = lsb > 0.0 and FEWEST_COUNTS <= full_scale / lsb <= MOST_COUNTS
        if packing not in PACKINGS or unit not in UNITS or not possible:
            raise StationRefused(
                f"{self.name}: packing {packing}, unit {unit}, {lsb:g} per count, full scale {full_scale:g}; known names and a "
                f"full scale of {FEWEST_COUNTS} to {MOST_COUNTS} counts are needed; check the reader's set-up and word order"
            )
        return Identity(
            str(values["serial"]), PACKINGS[packing], UNITS[unit], lsb, full_scale, int(_number(values["capacity"]))
        )

    def holds(self, serial: str) -> bool:
        """Whether that unit sits here now; asked anew."""
        return self._registers.text("serial") == serial

    def take(self) -> Samples:
        """Everything sampled since the last time; what the ring has lost is flagged, never made up."""
        identity = self.identity()
        head, tail, overflow = self._progress()
        if tail > head or (self._taken is not None and tail != self._taken):
            wanted = f"{self._taken}" if self._taken is not None else f"at most {head}"
            raise StationRefused(
                f"{self.name}: says that {tail} samples of {head} were taken, {wanted} is right; restart the reader"
            )
        first = max(tail, head - identity.capacity)
        counts = self._window(first, head, identity)
        if head > tail:
            self._tell_taken(head)
        return Samples(first, counts * identity.lsb, overflow or first > tail)

    def _progress(self) -> tuple[int, int, bool]:
        """Samples made, samples taken, and whether some were lost."""
        values = self._registers.read_group("progress")
        bit = self._registers.profile.register("flags").bits["overflow"]
        return (
            int(_number(values["head"])),
            int(_number(values["tail"])),
            bool(int(_number(values["flags"])) >> bit & 1),
        )

    def _tell_taken(self, head: int) -> None:
        """Tells how far samples were taken; where the answer is lost the slot is asked, and told again if it does not know."""
        try:
            self._registers.write("tail", head)
        except (StationTimeout, LinkLost):
            if self._progress()[1] != head:
                self._registers.write("tail", head)
        if self._taken is not None:
            self._taken = head

    def _window(self, first: int, head: int, identity: Identity) -> NDArray[np.float64]:
        """Counts (n, 3) of the samples numbered ``first`` to ``head`` − 1; numbers out of order are :class:`SamplesLost`."""
        fifo = self._registers.profile.fifo
        if fifo is None:
            raise StationRefused(
                f"{self.name}: profile {self._registers.profile.name} has no fifo, a slot needs one; add it"
            )
        width = WORDS_PER_SAMPLE[identity.packing]
        words: list[int] = []
        at = first
        while at < head:
            place = at % identity.capacity
            n = min(LONGEST_READ // width, head - at, identity.capacity - place)
            words += self._registers.words(fifo.address + place * width, n * width, "samples")
            at += n
        counts, numbers = unpack_samples(np.array(words, dtype=np.uint16), identity.packing)
        wrong = np.flatnonzero(numbers != np.arange(first, head) % SEQUENCE[identity.packing])
        if len(wrong):
            raise SamplesLost(
                f"{self.name}: sample {first + int(wrong[0])} does not follow the one before; check the reader"
            )
        return counts.astype(np.float64)

    def _named(self, name: str, value: Value) -> str:
        return named(self._registers.profile.register(name), _number(value))


def _number(value: Value) -> float:
    """The number that a register holds by its profile."""
    if isinstance(value, int | float):
        return value
    raise StationRefused(f"{value!r} is not a number; check the slot's profile")
