"""A device's registers by name: profile, codec and link together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.errors import StationRefused
from stations.codec import NotEncodable, Value, decode, encode, named

if TYPE_CHECKING:
    from collections.abc import Mapping

    from schemas.profile import Profile
    from stations.links.link import Link


class Registers:
    """Reads and writes of one device; ``name`` is what messages call it."""

    def __init__(self, name: str, link: Link, device_id: int, profile: Profile) -> None:
        self.name = name
        self.profile = profile
        self._link = link
        self._device_id = device_id

    def read(self, name: str) -> Value:
        """The value of a register: a number, a list where it has a count, a text."""
        register = self.profile.register(name)
        words = self._link.read(self._device_id, register.address, register.words, f"{self.name} {name}")
        return decode(register, self.profile.order(register), words)

    def number(self, name: str) -> float:
        """A register's number."""
        value = self.read(name)
        if not isinstance(value, int | float):
            message = f"{self.name}: {name} is {value!r}, a number is needed; check profile {self.profile.name}"
            raise StationRefused(message)
        return float(value)

    def numbers(self, name: str) -> list[float]:
        """The numbers of a register with a count."""
        value = self.read(name)
        if not isinstance(value, list):
            message = f"{self.name}: {name} is {value!r}, a list is needed; check profile {self.profile.name}"
            raise StationRefused(message)
        return value

    def text(self, name: str) -> str:
        """A register's text, or the name of its enumerated value."""
        value = self.read(name)
        if isinstance(value, str):
            return value
        if isinstance(value, list):
            message = f"{self.name}: {name} is a list, one value is needed; check profile {self.profile.name}"
            raise StationRefused(message)
        return named(self.profile.register(name), value)

    def flags(self, name: str) -> dict[str, bool]:
        """The named bits of a register."""
        value = int(self.number(name))
        return {flag: bool(value >> bit & 1) for flag, bit in self.profile.register(name).bits.items()}

    def read_group(self, group: str) -> dict[str, Value]:
        """Values of a group of registers, read in one request and so of one instant."""
        registers = [self.profile.register(name) for name in self.profile.groups[group]]
        first = registers[0].address
        words = self._link.read(self._device_id, first, registers[-1].end - first, f"{self.name} {group}")
        return {r.name: decode(r, self.profile.order(r), words[r.address - first : r.end - first]) for r in registers}

    def write(self, name: str, value: Value) -> None:
        """Writes one register, once."""
        register = self.profile.register(name)
        words = self._encoded(name, value)
        self._link.write(self._device_id, register.address, words, f"{self.name} {name} = {value}")

    def write_group(self, group: str, values: Mapping[str, Value]) -> None:
        """Writes a group of registers in one request, once."""
        names = self.profile.groups[group]
        words = [word for name in names for word in self._encoded(name, values[name])]
        address = self.profile.register(names[0]).address
        self._link.write(self._device_id, address, words, f"{self.name} {group} {dict(values)}")

    def words(self, address: int, count: int, what: str) -> list[int]:
        """Raw words, for windows that have no names."""
        return self._link.read(self._device_id, address, count, f"{self.name} {what}")

    def _encoded(self, name: str, value: Value) -> list[int]:
        register = self.profile.register(name)
        try:
            return encode(register, self.profile.order(register), value)
        except NotEncodable as problem:
            message = f"{self.name}: {problem}"
            raise StationRefused(message) from None
