"""Conversion between register words and values, in both directions; client and simulated station share it."""

import struct
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from schemas.profile import Register, WordOrder

Value = float | str | list[float]
Words = NDArray[np.uint16]
Counts = NDArray[np.int64]
Packing = Literal["int20x3", "int24x3", "int24x2", "int24x1"]

_FORMAT = {"uint16": ">H", "int16": ">h", "uint32": ">I", "int32": ">i", "float32": ">f"}
_RANGE = {
    "uint16": (0, 2**16 - 1),
    "int16": (-(2**15), 2**15 - 1),
    "uint32": (0, 2**32 - 1),
    "int32": (-(2**31), 2**31 - 1),
    "bit": (0, 1),
}
WORDS_PER_SAMPLE: dict[Packing, int] = {"int20x3": 4, "int24x3": 5, "int24x2": 4, "int24x1": 2}
SEQUENCE: dict[Packing, int] = {"int20x3": 16, "int24x3": 256, "int24x2": 256, "int24x1": 256}
BITS: dict[Packing, int] = {"int20x3": 20, "int24x3": 24, "int24x2": 24, "int24x1": 24}
OUTPUTS: dict[Packing, int] = {"int20x3": 3, "int24x3": 3, "int24x2": 2, "int24x1": 1}  # the number of axes of a sample


class NotEncodable(ValueError):
    """The register cannot hold the value."""


def encode(register: Register, order: WordOrder, value: Value) -> list[int]:
    """The words, or bits, of a value; a number outside the type or limits of the register is refused."""
    if register.type == "string":
        if not isinstance(value, str) or not value.isascii() or len(value) > 2 * register.count:
            raise NotEncodable(
                f"{register.name}: {value!r} is not an ASCII text of at most {2 * register.count} characters"
            )
        return list(struct.unpack(f">{register.count}H", value.encode("ascii").ljust(2 * register.count, b"\0")))
    values = value if isinstance(value, list) else [value]
    if len(values) != register.count:
        raise NotEncodable(
            f"{register.name}: {len(values)} values, {register.count} are needed; give one value for each"
        )
    return [word for number in values for word in _encode_number(register, order, number)]


def decode(register: Register, order: WordOrder, words: Sequence[int]) -> Value:
    """The value of words: a number, a list where the register has a count, or a text."""
    if register.type == "string":
        raw = struct.pack(f">{len(words)}H", *words)
        return raw.rstrip(b"\0").decode("ascii", errors="replace")
    size = register.words // register.count
    numbers = [_decode_number(register, order, words[i : i + size]) for i in range(0, len(words), size)]
    return numbers if register.count > 1 else numbers[0]


def _encode_number(register: Register, order: WordOrder, value: float | str) -> tuple[int, ...]:
    number = _number(register, value)
    if register.type == "float32":
        raw: float = number / register.scale
    else:
        raw = round(number / register.scale)
        low, high = _RANGE[register.type]
        if not low <= raw <= high:
            raise NotEncodable(
                f"{register.name}: {value} {register.unit} does not fit {register.type}; give a smaller value"
            )
        if register.type == "bit":
            return (int(raw),)
    packed = struct.pack(_FORMAT[register.type], raw)
    return _arranged(struct.unpack(f">{len(packed) // 2}H", packed), order)


def _arranged(words: tuple[int, ...], order: WordOrder) -> tuple[int, ...]:
    """Words in the order of the wire; each word order is its own inverse."""
    if order.startswith("low_first"):
        words = words[::-1]
    return tuple((w & 0xFF) << 8 | w >> 8 for w in words) if order.endswith("swapped") else words


def _number(register: Register, value: float | str) -> float:
    """The number of a value, checked against the limits of the register."""
    if isinstance(value, str):
        if value not in register.enumeration:
            raise NotEncodable(
                f"{register.name}: '{value}' is unknown; known values: {', '.join(register.enumeration) or 'none'}"
            )
        return register.enumeration[value] * register.scale
    low, high = register.minimum, register.maximum
    if (low is not None and not value >= low) or (high is not None and not value <= high):
        raise NotEncodable(f"{register.name}: {value} {register.unit} is outside {low} to {high}; give a value inside")
    return value


def _decode_number(register: Register, order: WordOrder, words: Sequence[int]) -> float:
    if register.type == "bit":
        return words[0]
    ordered = _arranged(tuple(words), order)
    raw = struct.unpack(_FORMAT[register.type], struct.pack(f">{len(ordered)}H", *ordered))[0]
    return raw * register.scale if register.scale != 1.0 else raw


def named(register: Register, value: float) -> str:
    """The name of an enumerated value, or ``unknown (n)``."""
    for name, number in register.enumeration.items():
        if number == value:
            return name
    return f"unknown ({value:g})"


def pack_samples(counts: Counts, first: int, packing: Packing) -> Words:
    """Samples packed into words, each with the low bits of its sample number.

    Parameters
    ----------
    counts : (n, ..., m), integers that fit the packing, m its number of axes
    first : number of the first sample since the start
    packing : three integers of 20 bits and a number of 4 in 4 words; or m integers of 24 bits and a number of 8, in 5, 4 or 2
        words, the number in the last 8 bits; most significant first

    Returns
    -------
    (n, ..., words)
    """
    number = (np.arange(first, first + len(counts)) % SEQUENCE[packing]).reshape(-1, *(1,) * (counts.ndim - 2))
    if packing == "int20x3":
        mask = np.uint64((1 << BITS[packing]) - 1)
        x, y, z = (counts[..., axis].astype(np.uint64) & mask for axis in range(3))
        packed = (x << np.uint64(44)) | (y << np.uint64(24)) | (z << np.uint64(4)) | number.astype(np.uint64)
        return packed.astype(">u8")[..., None].view(">u2").astype(np.uint16)
    data = np.zeros((*counts.shape[:-1], 2 * WORDS_PER_SAMPLE[packing]), dtype=np.uint8)
    low = np.ascontiguousarray(counts, dtype=">i4")[..., None].view(np.uint8)[..., 1:]  # three bytes of each axis
    data[..., : 3 * counts.shape[-1]] = low.reshape(*counts.shape[:-1], 3 * counts.shape[-1])
    data[..., -1] = number
    return data.view(">u2").astype(np.uint16)


def unpack_samples(words: Words, packing: Packing) -> tuple[Counts, Counts]:
    """The counts (n, m) of m axes and the low bits of the sample numbers (n,) in words (n·w,), w for each sample."""
    table = words.reshape(-1, WORDS_PER_SAMPLE[packing])
    sign = 1 << (BITS[packing] - 1)
    if packing == "int20x3":
        first, second, third, fourth = table.T.astype(np.int64)
        axes = (first << 4 | second >> 12, (second & 0xFFF) << 8 | third >> 8, (third & 0xFF) << 12 | fourth >> 4)
        counts, number = np.stack(axes, axis=-1), fourth & 0xF
    else:
        m, data = OUTPUTS[packing], table.astype(">u2").view(np.uint8).astype(np.int64)
        high, middle, low = np.moveaxis(data[:, : 3 * m].reshape(-1, m, 3), -1, 0)
        counts, number = high << 16 | middle << 8 | low, data[:, -1]
    return (counts ^ sign) - sign, number
