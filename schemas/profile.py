"""Register-map profiles: what every register of a device is called, where it is, and how its words are read.

A profile is TOML; the client and the simulated station read the same file, so a wrong address shows against hardware
only. ``verified`` says whether anybody has held it against the device.
"""

from __future__ import annotations

import tomllib
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, ValidationError, model_validator

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.recipe import Strict, explain

WordOrder = Literal["high_first", "low_first"]
RegisterType = Literal["uint16", "int16", "uint32", "int32", "float32", "string"]
Kind = Literal["axis", "chamber", "reader", "slot"]

WORDS: dict[str, int] = {"uint16": 1, "int16": 1, "uint32": 2, "int32": 2, "float32": 2, "string": 1}
ADDRESSES = 65536
LONGEST_WRITE = 123  # registers in one FC16 request (Modbus Application Protocol 1.1b3, 6.12)


class Register(Strict):
    """One value, or ``count`` of the same kind in a row, at a wire address.

    ``value = raw · scale``; ``minimum`` and ``maximum`` bound the value, in ``unit``. A string has ``count`` words of two
    characters.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    address: Annotated[int, Field(ge=0, lt=ADDRESSES)]
    manual: str = ""
    type: RegisterType
    count: Annotated[int, Field(ge=1)] = 1
    word_order: WordOrder | None = None
    scale: Annotated[FiniteFloat, Field(gt=0.0)] = 1.0
    unit: str = ""
    minimum: FiniteFloat | None = None
    maximum: FiniteFloat | None = None
    access: Literal["read", "write", "read_write"] = "read"
    enumeration: dict[str, int] = Field(default_factory=dict[str, int])
    bits: dict[str, int] = Field(default_factory=dict[str, int])
    source: str = ""

    @property
    def words(self) -> int:
        """Registers taken on the wire."""
        return WORDS[self.type] * self.count

    @property
    def end(self) -> int:
        """The first address behind the value."""
        return self.address + self.words

    @model_validator(mode="after")
    def _fits(self) -> Register:
        if self.end > ADDRESSES:
            message = f"{self.name}: ends at address {self.end}, the last one is {ADDRESSES - 1}; move or shorten it"
            raise ValueError(message)
        if (self.enumeration or self.bits) and self.type in {"float32", "string"}:
            message = f"{self.name}: {self.type} cannot hold an enumeration or bits; use an integer type"
            raise ValueError(message)
        return self


class Fifo(Strict):
    """The window onto a device's ring of samples: ``registers`` registers from ``address`` on."""

    address: Annotated[int, Field(ge=0, lt=ADDRESSES)]
    registers: Annotated[int, Field(ge=1, le=ADDRESSES)]


class Profile(Strict):
    """A device's register map."""

    name: str
    kind: Kind
    maker: str
    model: str
    verified: bool
    source: str
    word_order: WordOrder = "high_first"
    registers: Annotated[list[Register], Field(min_length=1)]
    groups: dict[str, list[str]] = Field(default_factory=dict[str, list[str]])
    fifo: Fifo | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Profile:
        _refuse_overlaps(self)
        for group, names in self.groups.items():
            _refuse_gaps(group, [self.register(name) for name in names])
        return self

    def register(self, name: str) -> Register:
        """The register of that name; an unknown one is refused with what looks like it."""
        for register in self.registers:
            if register.name == name:
                return register
        message = f"profile {self.name}: no register '{name}'; {did_you_mean(name, (r.name for r in self.registers))}"
        raise RecipeInvalid(message, key=name)

    def has(self, name: str) -> bool:
        """Whether there is a register of that name."""
        return any(register.name == name for register in self.registers)

    def order(self, register: Register) -> WordOrder:
        """The word order that holds for a register."""
        return register.word_order or self.word_order


def _refuse_overlaps(profile: Profile) -> None:
    spans = [(r.address, r.end, r.name) for r in profile.registers]
    if profile.fifo is not None:
        spans.append((profile.fifo.address, profile.fifo.address + profile.fifo.registers, "fifo"))
    spans.sort()
    for (_, end, name), (start, _, following) in pairwise(spans):
        if start < end:
            message = f"registers {name} and {following} overlap at address {start}; each needs its own; correct one"
            raise ValueError(message)
    names = [r.name for r in profile.registers]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        message = f"register {', '.join(twice)} is there twice, each name may be there once; rename one"
        raise ValueError(message)


def _refuse_gaps(group: str, registers: list[Register]) -> None:
    """A group is written in one request, so its registers follow each other without a gap."""
    for left, right in pairwise(registers):
        if left.end != right.address:
            message = f"group {group}: {right.name} does not follow {left.name} ({left.end} is needed); order them"
            raise ValueError(message)
    if sum(r.words for r in registers) > LONGEST_WRITE:
        message = f"group {group}: more than {LONGEST_WRITE} registers cannot be written in one request; split it"
        raise ValueError(message)


def parse_profile(text: str, source: str) -> Profile:
    """The profile in a TOML text, or :class:`RecipeInvalid` naming the key and what is needed."""
    try:
        return Profile.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as problem:
        message = f"{source}: not valid TOML: {problem}; correct the file"
        raise RecipeInvalid(message) from None
    except ValidationError as problem:
        raise explain(problem, source, Profile) from None
