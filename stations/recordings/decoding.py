"""What a recorded exchange says: names and values by the profile of its device, exceptions by their meaning."""

import struct

from schemas.profile import Command, Profile, Register
from stations.codec import Value, decode, named
from stations.links.frames import READ, WRITE_COIL, WRITE_COILS, WRITES, Malformed, Refused, unpack_bits, values_in
from stations.links.modbus import REASONS
from stations.links.recorder import SPACE_OF
from stations.recordings.frame_file import Exchange, RecordedDevice

MOST_WORDS = 8


def said(exchange: Exchange, device: RecordedDevice | None) -> str:
    """The answer of an exchange, or the values of an order, in words."""
    if exchange.text:
        return exchange.failed if exchange.reply is None else exchange.reply.decode("utf-8", errors="replace")
    if exchange.reply is None:
        return exchange.failed
    try:
        words = values_in(exchange.request, exchange.reply)
    except Refused as refusal:
        return f"exception {refusal.code} ({REASONS.get(refusal.code, 'unknown')})"
    except (Malformed, struct.error, IndexError) as problem:
        return f"no valid answer: {problem}"
    written = exchange.request[0] in WRITES
    values = _written(exchange.request) if written else words
    text = _values(exchange.request, values, device.profile if device is not None else None)
    return f"{text}, confirmed" if written else text


def told(entry: Register | Command, value: Value) -> str:
    """A value in words: its name, its bits, its number with the unit."""
    if isinstance(value, str):
        return f"'{value}'" if isinstance(entry, Register) else value
    if isinstance(value, list):
        return " ".join(f"{number:.6g}" for number in value[:MOST_WORDS]) + (" …" if len(value) > MOST_WORDS else "")
    if isinstance(entry, Register) and entry.enumeration:
        return named(entry, value)
    if isinstance(entry, Register) and entry.bits:
        flags = [name for name, bit in entry.bits.items() if int(value) >> bit & 1]
        return f"0x{int(value):X} ({', '.join(flags) or 'none'})"
    return f"{value:.7g} {entry.unit}".rstrip()


def _written(request: bytes) -> list[int]:
    if request[0] == WRITE_COIL:
        return [int(request[3:5] != b"\0\0")]
    if request[0] == WRITE_COILS:
        return unpack_bits(request[6:], int.from_bytes(request[3:5], "big"))
    return list(struct.unpack(f">{len(request[6:]) // 2}H", request[6 : 6 + len(request[6:]) // 2 * 2]))


def _values(request: bytes, values: list[int], profile: Profile | None) -> str:
    """Values of the whole registers in an address range, by name; words where no profile names them."""
    first = int.from_bytes(request[1:3], "big")
    space = SPACE_OF.get(request[0])
    named_values: list[str] = []
    for register in profile.registers if profile is not None else []:
        at = register.address - first
        if register.space == space and at >= 0 and at + register.words <= len(values) and profile is not None:
            value = decode(register, profile.order(register), values[at : at + register.words])
            named_values.append(f"{register.name} {told(register, value)}")
    if named_values:
        return ", ".join(named_values)
    if request[0] in {READ["coil"], READ["discrete"]}:
        return " ".join(map(str, values[: 4 * MOST_WORDS]))
    return " ".join(f"{word:04X}" for word in values[:MOST_WORDS]) + (
        f" … ({len(values)} words)" if len(values) > MOST_WORDS else ""
    )
