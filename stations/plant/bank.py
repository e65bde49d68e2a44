"""Registers of one simulated device: the profile on one side, the plant's values on the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from stations.codec import NotEncodable, Value, decode, encode

if TYPE_CHECKING:
    from schemas.profile import Profile, Register, Space

Source = Callable[[], Value]
Sink = Callable[[dict[str, Value]], None]
Window = Callable[[int, int], list[int]]


class Busy(Exception):
    """The device cannot do this now; the server answers exception 6."""


def refuse_write(values: dict[str, Value]) -> None:
    """The sink of a device that takes no commands."""
    raise NotEncodable(f"{', '.join(values)}: not to be written")


def number(values: dict[str, Value], name: str) -> float:
    """The number that is written to a register."""
    value = values[name]
    if not isinstance(value, int | float):
        raise NotEncodable(f"{name}: {value!r} is not a number")
    return float(value)


class Bank:
    """What a device's registers hold now, and what a write to them means."""

    def __init__(
        self, profile: Profile, sources: Mapping[str, Source], sink: Sink = refuse_write, window: Window | None = None
    ) -> None:
        self.profile = profile
        self._sources = dict(sources)
        self._sink = sink
        self._window = window
        self._registers = [self._scaled(register) for register in profile.registers]
        missing = [r.name for r in profile.registers if r.access != "write" and r.name not in self._sources]
        if missing:
            raise LookupError(
                f"profile {profile.name}: the plant has nothing for {', '.join(missing)}; add a source for each"
            )

    def _scaled(self, register: Register) -> Register:
        """The register in the decimals that the device is set to."""
        decimals = self._sources[register.scaled_by]() if register.scaled_by in self._sources else 0
        return register.with_decimals(decimals) if isinstance(decimals, int) and register.scaled_by else register

    def read(self, address: int, count: int, space: Space = "holding") -> list[tuple[int, list[int]]]:
        """Words, or bits, of every register that the span touches, each with its address."""
        fifo = self.profile.fifo
        if fifo is not None and self._window is not None and address >= fifo.address and space == "holding":
            return [(address, self._window(address - fifo.address, count))]
        end = address + count
        return [
            (r.address, encode(r, self.profile.order(r), self._sources[r.name]()))
            for r in self._registers
            if r.space == space and r.address < end and r.end > address and r.name in self._sources
        ]

    def write(self, address: int, words: list[int], space: Space = "holding") -> None:
        """Acts on the registers in the span; half a register, a value outside its limits or a read-only one is refused."""
        end = address + len(words)
        values: dict[str, Value] = {}
        for register in self._registers:
            if register.space == space and register.address < end and register.end > address:
                values[register.name] = self._value(register, address, words)
        self._sink(values)

    def _value(self, register: Register, address: int, words: list[int]) -> Value:
        first = register.address - address
        part = words[max(first, 0) : first + register.words]
        if register.access == "read" or first < 0 or len(part) != register.words:
            raise NotEncodable(f"{register.name}: read-only or cut in half; write whole registers that may be written")
        order = self.profile.order(register)
        value = decode(register, order, part)
        encode(register, order, value)  # refuses what is outside the limits
        return value
