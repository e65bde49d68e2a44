"""Malformed Modbus frames by the ten thousand: refused in time, never taken for a value, by the client and by the server."""

import io
import socket
import struct
import time
from contextlib import suppress

import numpy as np
import pytest
from long_suites import rounds
from plant_wires import tcp_link
from small_station import lot_of, plant_of

from schemas.errors import StationError
from schemas.station import load_station
from stations.links.frames import crc16
from stations.links.modbus import WireLink
from stations.links.serial_wire import SerialWire
from stations.links.wires import TcpWire
from stations.plant.server import PlantServer

TRUTH = [0x41B8, 0x0000, 0x1234, 0xFFFF]
UNIT, ADDRESS, UNITS = 3, 2780, (1, 3, 10, 11, 77, 255)
FEW, MANY = 2000, rounds(30_000, 100_000)
counts = pytest.mark.parametrize(
    "frames", [FEW, pytest.param(MANY, marks=[pytest.mark.slow, pytest.mark.timeout(1800)])]
)


def answer(number: int) -> bytearray:
    """The right answer, on TCP."""
    return bytearray(struct.pack(">HHHBBB4H", number, 0, 11, UNIT, 3, 8, *TRUTH))


def one_field_wrong(rng, number):
    """A field of the envelope, or of the answer before its words, with any other value."""
    frame = answer(number)
    frame[int(rng.integers(9))] ^= int(rng.integers(1, 256))
    return bytes(frame)


def another_count(rng, number):
    """Words missing or too many, told rightly by both counts."""
    n = int(rng.choice([0, 1, 2, 3, 5, 6, 120]))
    return struct.pack(f">HHHBBB{n}H", number, 0, 3 + 2 * n, UNIT, 3, 2 * n & 0xFF, *rng.integers(0, 65536, n))


def another_answer(rng, number):
    other = (number + int(rng.integers(1, 65536))) % 65536
    return struct.pack(">HHHBBB4H", other, 0, 11, UNIT, 3, 8, 1, 2, 3, 4)


def a_promise(rng, number):
    """A length that says more, or less."""
    frame = answer(number)
    frame[4:6] = int(rng.integers(12, 65536)).to_bytes(2, "big")
    return bytes(frame)


def noise(rng, _number):
    return rng.bytes(int(rng.integers(1, 300)))


ANSWERS = (
    one_field_wrong,
    another_count,
    a_promise,
    noise,
    lambda rng, number: struct.pack(
        ">HHHBBB", number, 0, 3, UNIT, 0x80 | int(rng.integers(128)), int(rng.integers(256))
    ),
    another_answer,
    lambda rng, number: bytes(answer(number)[: int(rng.integers(19))]),  # cut
    lambda rng, number: bytes(answer(number)[:9]) + rng.bytes(int(rng.integers(0, 8))),  # with a short body
    lambda rng, number: rng.bytes(int(rng.integers(1, 20))) + bytes(answer(number)),  # with bytes in front
    lambda _rng, number: struct.pack(">HHHBBHH", number, 0, 6, UNIT, 16, ADDRESS, 4),  # the confirmation of a write
)


@counts
def test_the_client_never_takes_a_malformed_answer_for_a_value(frames):
    rng, timeout = np.random.default_rng(1), 0.05
    wire = TcpWire("127.0.0.1", 1, timeout)
    link, outcomes, slowest = WireLink(wire, read_attempts=1), {"right": 0, "refused": 0}, 0.0
    for _ in range(frames):
        ours, theirs = socket.socketpair()
        wire._socket, number = ours, wire._number % 0xFFFF + 1
        theirs.sendall(ANSWERS[int(rng.integers(len(ANSWERS)))](rng, number))
        if rng.random() < 0.995:
            theirs.shutdown(socket.SHUT_WR)  # the rest are left open: the client has to give up by itself
        begun = time.monotonic()
        try:
            assert link.read(UNIT, ADDRESS, 4, "fuzz") == TRUTH
            outcomes["right"] += 1
        except StationError:
            outcomes["refused"] += 1
        slowest = max(slowest, time.monotonic() - begun)
        wire.close()
        theirs.close()
    assert outcomes["refused"] > 0.95 * frames
    assert slowest < timeout + 1.0  # seconds of a loaded machine, not of a hang


class Port(io.BytesIO):
    """A serial port that has heard something."""

    timeout = 0.0
    in_waiting = property(lambda self: len(self.getvalue()) - self.tell())

    def write(self, data):
        return len(data)

    def reset_input_buffer(self):
        pass


def spoilt_serial(rng) -> bytes:
    """A serial answer that is none; its check finds every three wrong bits and every burst of sixteen."""
    frame = bytearray(struct.pack(">BBB4H", UNIT, 3, 8, *TRUTH))
    frame += crc16(bytes(frame))
    kind = int(rng.integers(5))
    if kind == 0:
        return bytes(frame[: int(rng.integers(len(frame)))])
    if kind == 1:
        for place in rng.choice(8 * len(frame), int(rng.integers(1, 4)), replace=False):
            frame[place // 8] ^= 1 << place % 8
        return bytes(frame)
    if kind == 2:
        first, burst = int(rng.integers(len(frame) - 1)), int(rng.integers(1, 65536))
        frame[first] ^= burst >> 8
        frame[first + 1] ^= burst & 0xFF
        return bytes(frame)
    if kind == 3:
        return bytes(frame) + rng.bytes(int(rng.integers(1, 20)))
    return struct.pack(">BBB", UNIT, 0x80 | int(rng.integers(128)), 2) + rng.bytes(2)


@counts
def test_the_client_on_a_serial_line_never_takes_a_malformed_answer_for_a_value(frames):
    rng = np.random.default_rng(2)
    wire = SerialWire("fuzz", 0.0, baud=115200, parity="none", stop_bits=1)
    wire._quiet = 0.0
    link = WireLink(wire, read_attempts=1)
    for _ in range(frames):
        wire._port = Port(spoilt_serial(rng))
        with pytest.raises(StationError):
            link.read(UNIT, ADDRESS, 4, "fuzz")


def write_of(number, unit, address, words, told=None):
    n = len(words)
    return struct.pack(f">HHHBBHHB{n}H", number, 0, 7 + 2 * n, unit, 16, address, n, told or 2 * n, *words)


def another_function(rng, number):
    function = int(rng.choice([n for n in range(256) if n not in {5, 6, 15, 16, 22, 23}]))
    body = rng.bytes(int(rng.integers(0, 40)))
    return struct.pack(">HHHBB", number, 0, 2 + len(body), int(rng.choice(UNITS)), function) + body


def a_write_of_contradictions(rng, number):
    words, told = list(rng.integers(0, 65536, int(rng.integers(0, 5)))), int(rng.integers(0, 255))
    return write_of(number, UNIT, 2782, words, told + (told >= 2 * len(words)))


def a_read_by_chance(rng, number):
    address, count = (int(n) for n in rng.integers(0, 65536, 2))
    return struct.pack(">HHHBBHH", number, 0, 6, int(rng.choice(UNITS)), int(rng.integers(1, 5)), address, count)


def another_protocol(rng, number):
    protocol, length = int(rng.integers(1, 65536)), int(rng.integers(65536))
    return struct.pack(">HHHBBHH", number, protocol, length, UNIT, 3, 2782, 2)


# half of a value, a read-only one, infinity, no number
FORBIDDEN = ((2782, [0x41C8]), (2820, [0, 0x41C8]), (2782, [0, 0x7F80]), (2782, [0, 0x7FC0]))
REQUESTS = (
    noise,
    another_function,
    a_write_of_contradictions,
    a_read_by_chance,
    another_protocol,
    lambda rng, number: write_of(number, UNIT, 2782, [0, 0x41C8])[: int(rng.integers(17))],  # cut
    lambda rng, number: write_of(number, UNIT, *FORBIDDEN[int(rng.integers(4))]),
)


@counts
def test_the_server_survives_malformed_requests_and_takes_no_value_from_them(frames):
    rng, plant = np.random.default_rng(3), plant_of(load_station(), lot_of(1))

    def state():
        return [
            (device_id, register.name, bank._sources[register.name]())
            for device_id, bank in plant.banks.items()
            for register in bank.profile.registers
            if register.writable and register.name in bank._sources
        ]

    before = state()
    with PlantServer(plant) as server:
        sound = tcp_link(server.host, server.port, timeout_s=5.0, read_attempts=1)
        for n in range(frames):
            # a connection each: what follows half a frame would be taken for its end
            with socket.create_connection((server.host, server.port), timeout=5.0) as connection, suppress(OSError):
                connection.sendall(REQUESTS[int(rng.integers(len(REQUESTS)))](rng, n & 0xFFFF))
            if n % 100 == 0:  # a sound client is served as ever
                begun = time.monotonic()
                assert sound.read(UNIT, 2782, 2, "set point") == [0, 0x41B8]
                assert time.monotonic() - begun < 5.0
        assert sound.read(UNIT, 2782, 2, "set point") == [0, 0x41B8]
        sound.close()
    assert state() == before
