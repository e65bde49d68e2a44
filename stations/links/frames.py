"""Modbus requests and their answers; any other answer is malformed.

Source: Modbus Application Protocol 1.1b3, 6.1–6.12 and 7; Modbus over serial line 1.02, 6.2.2 (CRC).
"""

import struct
from collections.abc import Sequence

from schemas.profile import Space

READ = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}
WRITE_COIL, WRITE_COILS, WRITE_REGISTERS = 5, 15, 16
WRITES = frozenset({WRITE_COIL, WRITE_COILS, WRITE_REGISTERS})
ON, OFF = 0xFF00, 0x0000
DIAGNOSTICS, ECHO = 8, 0  # return query data: on a serial line only (6.8)
EXCEPTION = 0x80
BYTE = 8


class Malformed(Exception):
    """The received bytes are no valid answer to the request."""


class Refused(Exception):
    """The device answered with an exception code."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"exception {code}")


def read_request(space: Space, address: int, count: int) -> bytes:
    """The request that reads ``count`` registers or bits."""
    return struct.pack(">BHH", READ[space], address, count)


def write_request(space: Space, address: int, values: Sequence[int]) -> bytes:
    """The request that writes registers, or bits given as 0 and 1."""
    if space == "holding":
        n = len(values)
        return struct.pack(f">BHHB{n}H", WRITE_REGISTERS, address, n, 2 * n, *values)
    if len(values) == 1:
        return struct.pack(">BHH", WRITE_COIL, address, ON if values[0] else OFF)
    packed = pack_bits(values)
    return struct.pack(">BHHB", WRITE_COILS, address, len(values), len(packed)) + packed


def reply_size(request: bytes) -> int:
    """Size of the normal answer to a request, bytes."""
    function, count = request[0], int.from_bytes(request[3:5], "big")
    if function in {READ["holding"], READ["input"]}:
        return 2 + 2 * count
    if function in {READ["coil"], READ["discrete"]}:
        return 2 + (count + BYTE - 1) // BYTE
    return 5


def values_in(request: bytes, reply: bytes) -> list[int]:
    """The words or bits in the answer to a read, none for a write; :class:`Refused` or :class:`Malformed` otherwise."""
    function = request[0]
    if len(reply) == 2 and reply[0] == function | EXCEPTION and reply[1]:
        raise Refused(reply[1])
    size = reply_size(request)
    if len(reply) != size or reply[0] != function:
        shown = f"function {reply[0]}, {len(reply)} bytes" if reply else "nothing"
        raise Malformed(f"{shown}; function {function}, {size} bytes are needed")
    if function in WRITES:
        if reply != request[:5]:
            raise Malformed(f"the answer confirms {reply[1:].hex()}; {request[1:5].hex()} is needed")
        return []
    if reply[1] != size - 2:
        raise Malformed(f"the byte count is {reply[1]}; {size - 2} are needed")
    if function in {READ["holding"], READ["input"]}:
        return list(struct.unpack(f">{(size - 2) // 2}H", reply[2:]))
    return unpack_bits(reply[2:], int.from_bytes(request[3:5], "big"))


def echo_request(data: bytes) -> bytes:
    """The request on which a device on a serial line returns the same two bytes; it has no other effect (6.8.1)."""
    return struct.pack(">BH", DIAGNOSTICS, ECHO) + data


def read_of_other_size(request: bytes) -> bytes:
    """A read whose answer has another size than that of a request: one register or bit, or more where the request reads one.

    For a write it is a read of one register, which has another function code.
    """
    if request[0] in WRITES:
        return read_request("holding", int.from_bytes(request[1:3], "big"), 1)
    function, address, count = struct.unpack(">BHH", request)
    other = 1 if reply_size(request) != reply_size(struct.pack(">BHH", function, address, 1)) else BYTE + count
    return struct.pack(">BHH", function, address, other)


def ends_with_sign(heard: bytes, device_id: int, sign: bytes) -> bool:
    """Whether received bytes end with the answer of a device to an echo, or to a read of a distinct size.

    A device without the echo function answers with an exception of that function code, which no other request causes. An
    exception to the read could belong to an earlier read, so it does not count.
    """
    frame = bytes([device_id]) + sign
    if sign[0] == DIAGNOSTICS:
        refusal = heard[-5:]
        refused = refusal[:2] == bytes([device_id, DIAGNOSTICS | EXCEPTION]) and crc16(refusal[:-2]) == refusal[-2:]
        return heard.endswith(frame + crc16(frame)) or refused
    size = reply_size(sign)
    answer = heard[-(size + 3) :]
    head = bytes([device_id, sign[0], size - 2])
    return len(answer) == size + 3 and answer.startswith(head) and crc16(answer[:-2]) == answer[-2:]


def pack_bits(values: Sequence[int]) -> bytes:
    """Bits packed into bytes, the first in the least significant bit."""
    return sum(1 << i for i, value in enumerate(values) if value).to_bytes((len(values) + BYTE - 1) // BYTE, "little")


def unpack_bits(data: bytes, count: int) -> list[int]:
    """The first ``count`` bits in bytes."""
    number = int.from_bytes(data, "little")
    return [number >> i & 1 for i in range(count)]


def _crc_table() -> tuple[int, ...]:
    table: list[int] = []
    for byte in range(256):
        crc = byte
        for _ in range(BYTE):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
        table.append(crc)
    return tuple(table)


_CRC = _crc_table()


def crc16(data: bytes) -> bytes:
    """The CRC of a serial frame, low byte first, in transmission order."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC[(crc ^ byte) & 0xFF]
    return crc.to_bytes(2, "little")
