"""Register-map profiles: what every register of a device is called, where it is, and how its words are read.

A profile is TOML; the client and the simulated station read the same file, so a wrong address shows against hardware
only. ``verified`` states whether it was compared with the device.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Literal, TypeVar

from pydantic import Field, model_validator

from schemas.bounds import Number
from schemas.errors import RecipeInvalid, did_you_mean
from schemas.motion import Motion
from schemas.strict import Strict

WordOrder = Literal["high_first", "low_first", "high_first_swapped", "low_first_swapped"]
RegisterType = Literal["uint16", "int16", "uint32", "int32", "float32", "string", "bit"]
Space = Literal["holding", "input", "coil", "discrete"]
Equipment = Literal["exciter", "shock_machine", "centrifuge", "power_supply", "step_generator", "climate"]
"""What a procedure borrows beside the table: one role of a station each."""
Kind = Literal["axis", "chamber", "reader", "slot", Equipment]
Carrier = Literal["tcp", "rtu", "tls", "ascii", "visa"]
TEXT_CARRIERS: frozenset[Carrier] = frozenset({"ascii", "visa"})
Adapter = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]  # the family, a module in stations/devices/families

WORDS: dict[str, int] = {"uint16": 1, "int16": 1, "uint32": 2, "int32": 2, "float32": 2, "string": 1, "bit": 1}
BITS: frozenset[str] = frozenset({"coil", "discrete"})
READ_ONLY: frozenset[str] = frozenset({"input", "discrete"})
UNCONVERTED = ("degF", "°F", "F", "K")  # temperatures are taken as degC
ADDRESSES = 65536
LONGEST_WRITE = 123  # registers in one FC16 request (Modbus Application Protocol 1.1b3, 6.12)


class Register(Strict):
    """One value, or ``count`` of the same kind in a row, at a wire address of one of Modbus' four spaces.

    ``value = raw · scale``, over ten to the power that the register ``scaled_by`` holds where one is named; ``minimum`` and
    ``maximum`` bound the value, in ``unit``. A string has ``count`` words of two characters. ``disputed`` says what sources
    disagree about. ``source`` is the profile's where none is named. ``column`` names the column under which a reader's value is
    recorded beside every dwell: a covariate that a missing effect may depend on.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    address: Annotated[int, Field(ge=0, lt=ADDRESSES)]
    space: Space = "holding"
    manual: str = ""
    type: RegisterType
    count: Annotated[int, Field(ge=1, le=ADDRESSES)] = 1
    word_order: WordOrder | None = None
    scale: Annotated[Number, Field(gt=0.0)] = 1.0
    scaled_by: str = ""
    unit: str = ""
    minimum: Number | None = None
    maximum: Number | None = None
    access: Literal["read", "write", "read_write"] = "read"
    enumeration: dict[str, int] = Field(default_factory=dict[str, int])
    bits: dict[str, int] = Field(default_factory=dict[str, int])
    source: str = ""
    disputed: str = ""
    column: Annotated[str, Field(pattern=r"^([A-Za-z][A-Za-z0-9_]*)?$")] = ""

    @property
    def writable(self) -> bool:
        """Whether the register may be written."""
        return self.access != "read"

    def with_decimals(self, decimals: int) -> "Register":
        """The register with its values in steps of ten to the power of minus ``decimals``."""
        return self.model_copy(update={"scale": self.scale * 10.0**-decimals, "scaled_by": ""})

    @property
    def words(self) -> int:
        """Registers, or bits, taken on the wire."""
        return WORDS[self.type] * self.count

    @property
    def end(self) -> int:
        """The first address behind the value."""
        return self.address + self.words

    @model_validator(mode="after")
    def _fits(self) -> "Register":
        wrong = ""
        if self.end > ADDRESSES:
            wrong = f"ends at address {self.end}, the last one is {ADDRESSES - 1}; move or shorten it"
        elif (self.space in BITS) != (self.type == "bit"):
            wrong = f"type {self.type} in space {self.space}; coils and discrete inputs hold bits, others none"
        elif self.space in READ_ONLY and self.writable:
            wrong = f"access {self.access} in space {self.space}, which can only be read; correct one"
        elif self.column and (self.type in {"string", "bit"} or self.count > 1 or self.access == "write"):
            wrong = f"column '{self.column}', one number that can be read is needed; record another register"
        elif (self.enumeration or self.bits) and self.type in {"float32", "string"}:
            wrong = f"{self.type} cannot hold an enumeration or bits; use an integer type"
        if wrong:
            raise ValueError(f"{self.name}: {wrong}")
        return self


class Command(Strict):
    """One value of a device with a text protocol.

    ``ask`` is the question whose answer's comma-separated part ``field`` is the value; ``tell`` is the line that sets it, with
    one pair of braces for the value. What has no ``tell`` is never written.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    ask: str
    field: Annotated[int, Field(ge=0, le=1000)] = 0
    tell: Annotated[str, Field(pattern=r"^([^{}]*\{[^{}]*\}[^{}]*)?$")] = ""
    manual: str = ""
    type: Literal["number", "text"] = "number"
    unit: str = ""
    minimum: Number | None = None
    maximum: Number | None = None
    values: list[str] = Field(default_factory=list[str])
    source: str = ""
    disputed: str = ""

    @property
    def writable(self) -> bool:
        """Whether the command may be set."""
        return bool(self.tell)


AnyEntry = TypeVar("AnyEntry", Register, Command)


def limits_of(entry: Register | Command) -> tuple[float, float]:
    """Smallest and largest value, infinite where there is no limit."""
    low = -math.inf if entry.minimum is None else entry.minimum
    return low, math.inf if entry.maximum is None else entry.maximum


class Fifo(Strict):
    """The window onto a device's ring of samples: ``registers`` registers from ``address`` on."""

    address: Annotated[int, Field(ge=0, lt=ADDRESSES)]
    registers: Annotated[int, Field(ge=1, le=ADDRESSES)]


class Encoder(Strict):
    """How old a reading of an axis' encoder is when its request is half answered, and by how much that differs; ms (k = 1)."""

    latency_ms: Annotated[Number, Field(ge=0.0, le=1000.0)]
    jitter_ms: Annotated[Number, Field(gt=0.0, le=100.0)]


class Profile(Strict):
    """A device's register map, or its lines of text.

    ``adapter`` names what its commands mean; ``links`` what carries them, the device's own way first. ``motion`` holds the limits
    of an exciter, ``encoder`` how late that of an axis is read (none: a turn of it is no measurement), ``stated`` the largest
    values of a station's file (:meth:`limited`).
    """

    name: str
    kind: Kind
    adapter: Adapter
    maker: str
    model: str
    verified: bool
    source: str
    links: Annotated[list[Carrier], Field(min_length=1)] = Field(default_factory=lambda: list[Carrier](["tcp"]))
    word_order: WordOrder = "high_first"
    registers: list[Register] = Field(default_factory=list[Register])
    commands: list[Command] = Field(default_factory=list[Command])
    groups: dict[str, list[str]] = Field(default_factory=dict[str, list[str]])
    fifo: Fifo | None = None
    motion: Motion | None = None
    encoder: Encoder | None = None
    stated: dict[str, Number] = Field(default_factory=dict[str, float])

    @model_validator(mode="after")
    def _consistent(self) -> "Profile":
        spoken = set(self.links) <= TEXT_CARRIERS
        if not (self.commands if spoken else self.registers) or (self.registers if spoken else self.commands):
            carriers = ", ".join(self.links)
            raise ValueError(
                f"links {carriers}: a device on ascii or visa has commands alone, any other registers alone; correct it"
            )
        for entry in (*self.registers, *self.commands):
            low, high = limits_of(entry)
            if low > high:
                raise ValueError(f"{entry.name}: minimum {low:g} is above maximum {high:g}; exchange or correct them")
            if entry.unit in UNCONVERTED:
                raise ValueError(f"{entry.name}: unit {entry.unit}, degC is needed; set the controller to Celsius")
        _refuse_overlaps(self)
        for register in self.registers:
            if register.scaled_by:
                self.register(register.scaled_by)
        for group, names in self.groups.items():
            _refuse_gaps(group, [self.register(name) for name in names])
        return self

    def register(self, name: str) -> Register:
        """The register of that name; an unknown name is refused, with similar names."""
        return self._named(name, "register", self.registers)

    def command(self, name: str) -> Command:
        """The command of that name; an unknown name is refused, with similar names."""
        return self._named(name, "command", self.commands)

    def _named(self, name: str, what: str, entries: Sequence[AnyEntry]) -> AnyEntry:
        for entry in entries:
            if entry.name == name:
                return entry
        known = did_you_mean(name, (entry.name for entry in entries))
        raise RecipeInvalid(f"profile {self.name}: no {what} '{name}'; {known}", key=name)

    def entry(self, name: str) -> Register | Command:
        """The register or command of that name."""
        return self.command(name) if self.commands else self.register(name)

    def limited(self, maximum: Mapping[str, float]) -> "Profile":
        """The profile with smaller largest values, by the names of its numeric orders and of the limits of motion.

        Raises
        ------
        RecipeInvalid
            No order and no limit has this name.
        """
        if not maximum:
            return self
        orders = [e.name for e in (*self.registers, *self.commands) if e.writable and e.type not in {"text", "string"}]
        moving = list(Motion.model_fields) if self.kind == "exciter" else []
        for name in maximum:
            if name not in orders and name not in moving:
                raise RecipeInvalid(
                    f"maximum: profile {self.name} has no order '{name}'; {did_you_mean(name, [*orders, *moving])}",
                    key="maximum",
                )

        def least(name: str, stated: float | None) -> dict[str, float]:
            return {"maximum": min(maximum[name], math.inf if stated is None else stated)} if name in maximum else {}

        motion = Motion(**{name: value for name, value in maximum.items() if name in moving})
        return self.model_copy(
            update={
                "registers": [r.model_copy(update=least(r.name, r.maximum)) for r in self.registers],
                "commands": [c.model_copy(update=least(c.name, c.maximum)) for c in self.commands],
                "stated": {**self.stated, **maximum},
                "motion": motion if self.motion is None else self.motion.tighter(motion),
            }
        )

    def has(self, name: str) -> bool:
        """Whether there is a register, command or group of that name."""
        return name in self.groups or any(entry.name == name for entry in (*self.registers, *self.commands))

    def order(self, register: Register) -> WordOrder:
        """The word order that holds for a register."""
        return register.word_order or self.word_order

    def may_write(self, space: Space, address: int, count: int) -> bool:
        """Whether ``count`` registers or bits from an address on are whole registers that may be written, and nothing else."""
        end, at = address + count, address
        for register in sorted(self.registers, key=lambda r: r.address):
            if register.space == space and register.address == at and register.end <= end and register.writable:
                at = register.end
        return at == end > address


def _refuse_overlaps(profile: Profile) -> None:
    spans = [(r.space, r.address, r.end, r.name) for r in profile.registers]
    if profile.fifo is not None:
        spans.append(("holding", profile.fifo.address, profile.fifo.address + profile.fifo.registers, "fifo"))
    spans.sort()
    for (space, _, end, name), (next_space, start, _, following) in pairwise(spans):
        if space == next_space and start < end:
            raise ValueError(
                f"registers {name} and {following} overlap at address {start}; each needs its own; correct one"
            )
    names = [entry.name for entry in (*profile.registers, *profile.commands)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"register {', '.join(twice)} is there twice, each name may be there once; rename one")


def _refuse_gaps(group: str, registers: list[Register]) -> None:
    """A group is written in one request, so its registers follow each other without a gap."""
    for left, right in pairwise(registers):
        if left.end != right.address or left.space != right.space:
            raise ValueError(
                f"group {group}: {right.name} does not follow {left.name} ({left.end} is needed); order them"
            )
    if sum(r.words for r in registers) > LONGEST_WRITE:
        raise ValueError(
            f"group {group}: more than {LONGEST_WRITE} registers cannot be written in one request; split it"
        )
