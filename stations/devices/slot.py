"""One slot of the reader: who sits there, and the samples in its memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schemas.errors import StationRefused
from stations.codec import SEQUENCE, WORDS_PER_SAMPLE, Packing, named, unpack_samples

if TYPE_CHECKING:
    from stations.codec import Value
    from stations.devices.registers import Registers

LONGEST_READ = 125  # registers in one request
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


class Slot:
    """A device under test behind the reader."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self.name = registers.name
        self._identity: Identity | None = None

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
        if packing not in PACKINGS or unit not in UNITS or not (lsb > 0.0 and full_scale > 0.0):
            message = (
                f"{self.name}: packing {packing}, unit {unit}, {lsb:g} per count, full scale {full_scale:g}; known names "
                "and positive numbers are needed; check the reader's set-up"
            )
            raise StationRefused(message)
        return Identity(
            str(values["serial"]), PACKINGS[packing], UNITS[unit], lsb, full_scale, int(_number(values["capacity"]))
        )

    def take(self) -> Samples:
        """Everything sampled since the last time; what the ring has lost is flagged, never made up."""
        identity = self.identity()
        progress = self._registers.read_group("progress")
        head, tail = int(_number(progress["head"])), int(_number(progress["tail"]))
        overflow = bool(
            int(_number(progress["flags"])) >> self._registers.profile.register("flags").bits["overflow"] & 1
        )
        if tail > head:
            message = f"{self.name}: {tail} samples taken of {head}, at most {head} can be; restart the reader"
            raise StationRefused(message)
        first = max(tail, head - identity.capacity)
        overflow = overflow or first > tail
        counts = self._window(first, head, identity)
        if head > tail:
            self._registers.write("tail", head)
        return Samples(first, counts * identity.lsb, overflow)

    def _window(self, first: int, head: int, identity: Identity) -> NDArray[np.float64]:
        """Counts (n, 3) of the samples numbered ``first`` to ``head`` − 1; numbers out of order are refused."""
        fifo = self._registers.profile.fifo
        if fifo is None:
            message = f"{self.name}: profile {self._registers.profile.name} has no fifo, a slot needs one; add it"
            raise StationRefused(message)
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
            message = f"{self.name}: sample {first + int(wrong[0])} does not follow the one before; check the reader"
            raise StationRefused(message)
        return counts.astype(np.float64)

    def _named(self, name: str, value: Value) -> str:
        return named(self._registers.profile.register(name), _number(value))


def _number(value: Value) -> float:
    """The number that a register holds by its profile."""
    if isinstance(value, int | float):
        return value
    message = f"{value!r} is not a number; check the slot's profile"
    raise StationRefused(message)
