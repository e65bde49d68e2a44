"""Registers of one simulated device: the profile connected to the values of the plant."""

from collections.abc import Callable, Mapping
from functools import partial

from schemas.profile import Profile, Register, Space
from stations.codec import NotEncodable, Value, decode, encode

Source = Callable[[], Value]
Sink = Callable[[dict[str, Value]], None]
Window = Callable[[int, int], list[int]]


class Busy(Exception):
    """The device cannot carry this out now; the server answers with exception 6."""


def number(values: dict[str, Value], name: str) -> float:
    """The number in a write to a register."""
    value = values[name]
    if not isinstance(value, int | float):
        raise NotEncodable(f"{name}: {value!r} is not a number")
    return float(value)


def stored(values: Mapping[str, Value]) -> dict[str, Source]:
    """Sources of registers that hold what was last written to them."""
    return {name: partial(values.__getitem__, name) for name in values}


def store(values: dict[str, Value], written: Mapping[str, Value]) -> None:
    """Takes over the written values of known names."""
    values.update({name: value for name, value in written.items() if name in values})


def bits_of(register: Register, flags: Mapping[str, bool]) -> int:
    """The value of a register whose named bits are set or not."""
    return sum(1 << register.bits[flag] for flag, is_set in flags.items() if is_set)


class Bank:
    """The present values of the registers of a device, and the effect of writes."""

    def __init__(
        self, profile: Profile, sources: Mapping[str, Source], sink: Sink, window: Window | None = None
    ) -> None:
        self.profile = profile
        self._sources = dict(sources)
        self._sink = sink
        self._window = window
        self._registers = [self._scaled(register) for register in profile.registers]
        self._addresses: dict[Space, set[int]] = {}
        for register in profile.registers:
            self._addresses.setdefault(register.space, set()).update(range(register.address, register.end))
        missing = [r.name for r in profile.registers if r.access != "write" and r.name not in self._sources]
        if missing:
            raise LookupError(
                f"profile {profile.name}: the plant has nothing for {', '.join(missing)}; add a source for each"
            )

    def _scaled(self, register: Register) -> Register:
        """The register with the decimals that are set in the device."""
        decimals = self._sources[register.scaled_by]() if register.scaled_by in self._sources else 0
        return register.with_decimals(decimals) if isinstance(decimals, int) and register.scaled_by else register

    def has(self, address: int, space: Space) -> bool:
        """Whether a register, or the window of the samples, is at this address."""
        fifo = self.profile.fifo
        if fifo is not None and space == "holding" and address >= fifo.address:
            return True
        return address in self._addresses.get(space, ())

    def read(self, address: int, count: int, space: Space = "holding") -> list[tuple[int, list[int]]]:
        """Words, or bits, of every register in an address range, each with its address."""
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
        """Writes the registers in an address range; an incomplete or read-only register or a value outside limits is refused."""
        end = address + len(words)
        touched = (r for r in self._registers if r.space == space and r.address < end and r.end > address)
        self._sink({register.name: self._value(register, address, words) for register in touched})

    def _value(self, register: Register, address: int, words: list[int]) -> Value:
        first = register.address - address
        part = words[max(first, 0) : first + register.words]
        if register.access == "read" or first < 0 or len(part) != register.words:
            raise NotEncodable(f"{register.name}: read-only or incomplete; write whole writable registers")
        order = self.profile.order(register)
        value = decode(register, order, part)
        encode(register, order, value)  # refuses a value outside the limits
        return value
