"""Registers of a device by name: profile, codec and link together."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager

from schemas.errors import LinkLost, StationRefused, StationTimeout
from schemas.profile import Profile, Register, Space
from stations.clock import steady
from stations.codec import NotEncodable, Value, decode, encode, named
from stations.links.gate import GatedLink


class Registers:
    """Reads and writes of one device; ``name`` is its name in messages."""

    def __init__(self, name: str, link: GatedLink, device_id: int, profile: Profile) -> None:
        self.name = name
        self.profile = profile
        self._link = link
        self._device_id = device_id
        self._decimals: dict[str, int] = {}
        self._read_at: float | None = None
        self._deciding = False

    @contextmanager
    def deciding(self) -> Generator[None]:
        """A block whose commands depend on its readings: the gate refuses a command that comes too late after the reading."""
        self._read_at, self._deciding = None, True
        try:
            yield
        finally:
            self._deciding = False

    def has(self, name: str) -> bool:
        """Whether the device has a register or group of that name."""
        return self.profile.has(name)

    def read(self, name: str) -> Value:
        """The value of a register: a number, a list where it has a count, a text."""
        register = self._scaled(name)
        words = self._read_words(register.address, register.words, name, register.space)
        return decode(register, self.profile.order(register), words)

    def raw(self, name: str) -> list[int]:
        """The words, or bits, of a register as they are on the wire."""
        register = self.profile.register(name)
        return self._read_words(register.address, register.words, name, register.space)

    def number(self, name: str) -> float:
        """The value of a numeric register."""
        return float(self.number_in(name, self.read(name)))

    def number_in(self, name: str, value: Value) -> float:
        """The number of a register in a value that was read with a group."""
        if not isinstance(value, int | float):
            raise self._wrong(name, f"{value!r}", "a number")
        return value

    def numbers(self, name: str) -> list[float]:
        """The numbers of a register with a count."""
        value = self.read(name)
        if not isinstance(value, list):
            raise self._wrong(name, f"{value!r}", "a list")
        return value

    def text(self, name: str) -> str:
        """The text of a register, or the name of its enumerated value."""
        value = self.read(name)
        if isinstance(value, str):
            return value
        if isinstance(value, list):
            raise self._wrong(name, "a list", "one value")
        return named(self.profile.register(name), value)

    def flags(self, name: str) -> dict[str, bool]:
        """The named bits of a register."""
        return self.flags_in(name, self.number(name))

    def flags_in(self, name: str, value: Value) -> dict[str, bool]:
        """The named bits of a register in a value that was read with a group."""
        value = self.number_in(name, value)
        return {flag: bool(int(value) >> bit & 1) for flag, bit in self.profile.register(name).bits.items()}

    def names_in(self, group: str) -> dict[str, str]:
        """Names of the enumerated values of a group, read in one request."""
        values = self.read_group(group)
        return {n: named(self.profile.register(n), v) for n, v in values.items() if isinstance(v, int | float)}

    def step(self, name: str) -> float:
        """The smallest change that a register can hold; zero for a float."""
        register = self._scaled(name)
        return 0.0 if register.type == "float32" else register.scale

    def read_group(self, group: str) -> dict[str, Value]:
        """Values of a group of registers, read in one request."""
        registers = [self._scaled(name) for name in self.profile.groups[group]]
        first = registers[0].address
        words = self._read_words(first, registers[-1].end - first, group, registers[0].space)
        return {r.name: decode(r, self.profile.order(r), words[r.address - first : r.end - first]) for r in registers}

    def write(self, name: str, value: Value) -> None:
        """Writes one register, once."""
        register = self._scaled(name)
        words = self._encoded(register, value)
        self._order(register.address, words, f"{name} = {value}", register.space)

    def write_group(self, group: str, values: Mapping[str, Value]) -> None:
        """Writes a group of registers in one request, once."""
        registers = [self._scaled(name) for name in self.profile.groups[group]]
        words = [word for register in registers for word in self._encoded(register, values[register.name])]
        self._order(registers[0].address, words, f"{group} {dict(values)}", registers[0].space)

    def set_group(self, group: str, values: Mapping[str, Value]) -> None:
        """Writes registers that start no action in one request, once; the values read back decide, also after a lost answer."""
        lost: StationTimeout | LinkLost | None = None
        try:
            self.write_group(group, values)
        except (StationTimeout, LinkLost) as problem:
            lost = problem
        actual = self.read_group(group)
        for name, value in values.items():
            if actual[name] != self._as_held(name, value):
                raise lost or StationRefused(
                    f"{self.name}: {name} is {actual[name]} {self.profile.register(name).unit} after {value} was written; "
                    "nothing was started; check the device"
                )

    def set(self, name: str, value: Value) -> None:
        """Writes a register that keeps its value, once, and reads it back, which decides after a lost answer."""
        lost: StationTimeout | LinkLost | None = None
        try:
            self.write(name, value)
        except (StationTimeout, LinkLost) as problem:
            lost = problem
        if self.read(name) != self._as_held(name, value):
            raise lost or StationRefused(
                f"{self.name}: {name} is {self.read(name)} after {value} was written, {value} is needed; "
                "check the device's panel and its write protection"
            )

    def words(self, address: int, count: int, what: str) -> list[int]:
        """Raw words of an address range without register names."""
        return self._read_words(address, count, what)

    def _read_words(self, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        words = self._link.read(self._device_id, address, count, f"{self.name} {what}", space)
        self._read_at = steady()
        return words

    def _order(self, address: int, words: list[int], what: str, space: Space) -> None:
        since = self._read_at if self._deciding else None
        self._link.write(self._device_id, address, words, f"{self.name} {what}", space, since=since)

    def _wrong(self, name: str, found: str, needed: str) -> StationRefused:
        return StationRefused(f"{self.name}: {name} is {found}, {needed} is needed; check profile {self.profile.name}")

    def _as_held(self, name: str, value: Value) -> Value:
        """A value as a register holds it, rounded to its steps."""
        register = self._scaled(name)
        return decode(register, self.profile.order(register), self._encoded(register, value))

    def _scaled(self, name: str) -> Register:
        """The register with the decimals that are set in the device; they are read once."""
        register = self.profile.register(name)
        by = register.scaled_by
        if not by:
            return register
        if by not in self._decimals:
            self._decimals[by] = int(self.number(by))
        return register.with_decimals(self._decimals[by])

    def _encoded(self, register: Register, value: Value) -> list[int]:
        try:
            return encode(register, self.profile.order(register), value)
        except NotEncodable as problem:
            raise StationRefused(f"{self.name}: {problem}") from None
