"""Modbus over a serial line: frames with a CRC and without a transaction number, on a line shared by several devices."""

import os
import termios
import time
from collections.abc import Callable

import serial
from serial import PARITY_EVEN, PARITY_NONE, PARITY_ODD, Serial

from stations.links.frames import (
    EXCEPTION,
    Malformed,
    crc16,
    echo_request,
    ends_with_sign,
    read_of_other_size,
    reply_size,
)
from stations.links.wires import CHUNK, Broken, Silence, Unreachable, reason_of

PARITIES = {"none": PARITY_NONE, "even": PARITY_EVEN, "odd": PARITY_ODD}
EXCEPTION_FRAME = 5  # device, function, code, check
QUIET_CHARACTERS = 3.5  # Modbus over serial line 1.02, 2.5.1.1
QUIET_S = 0.00175  # above 19200 baud


class SerialWire:
    """Modbus RTU over a serial line.

    A serial frame has no transaction number, so that a late answer could be mistaken for the answer to the next request. After a
    failure the wire therefore discards input for the longest answer time, then sends a request with a distinct answer, the sign.
    A device answers in order: after the sign no answer to an earlier request can follow.
    """

    def __init__(self, device: str, timeout_s: float, *, baud: int, parity: str, stop_bits: int) -> None:
        self.where = device
        self.timeout_s = timeout_s
        self._baud, self._parity, self._stop_bits = baud, PARITIES[parity], stop_bits
        self._port: Serial | None = None
        self._late_until = 0.0
        # devices with an outstanding answer, and the number of requests for a sign since
        self._unsure: dict[int, int] = {}
        character = (10 if parity == "none" else 11) / baud
        self._quiet = max(QUIET_S, QUIET_CHARACTERS * character)
        self._last_input = 0.0

    def exchange(self, device_id: int, request: bytes, before: Callable[[], None] | None = None) -> bytes:
        """The answer to a request; its CRC must be correct."""
        frame = bytes([device_id]) + request
        try:
            port = self._opened()
            self._discard_late_input(port)
            if device_id in self._unsure:
                self._await_sign(port, device_id, request)
            if before is not None:
                before()
            port.write(frame + crc16(frame))
            return self._answer(port, device_id, request)
        except (Silence, Malformed):
            self.close()
            self._late_until = time.monotonic() + self.timeout_s
            self._unsure.setdefault(device_id, 0)
            raise
        except (serial.SerialException, OSError, termios.error) as problem:  # settings that the line does not support
            kind = Unreachable if self._port is None else Broken
            self.close()
            raise kind(reason_of(problem)) from None

    def close(self) -> None:
        """Closes the line."""
        if self._port is not None:
            self._port.close()
        self._port = None

    def _opened(self) -> Serial:
        if self._port is None:
            self._port = Serial(
                self.where,
                self._baud,
                parity=self._parity,
                stopbits=self._stop_bits,
                timeout=self.timeout_s,
                write_timeout=self.timeout_s,
                exclusive=True,
            )
        return self._port

    def _discard_late_input(self, port: Serial) -> None:
        """Discards late input, and waits for the silent interval that ends a frame."""
        while (left := self._late_until - time.monotonic()) > 0.0:
            port.timeout = left
            port.read(CHUNK)
        time.sleep(max(0.0, self._last_input + self._quiet - time.monotonic()))
        port.reset_input_buffer()

    def _await_sign(self, port: Serial, device_id: int, request: bytes) -> None:
        """Discards input until the sign of the device arrives; :class:`Silence` without it."""
        tries = self._unsure[device_id]
        self._unsure[device_id] = tries + 1
        sign = echo_request(os.urandom(2)) if tries % 2 == 0 else read_of_other_size(request)
        frame = bytes([device_id]) + sign
        port.write(frame + crc16(frame))
        deadline, received = time.monotonic() + self.timeout_s, b""
        while not ends_with_sign(received, device_id, sign):
            received += _read(port, max(1, port.in_waiting), deadline)
        self._last_input = time.monotonic()
        del self._unsure[device_id]
        self._discard_late_input(port)

    def _answer(self, port: Serial, device_id: int, request: bytes) -> bytes:
        deadline = time.monotonic() + self.timeout_s
        data = _read(port, EXCEPTION_FRAME, deadline)
        if data[0] != device_id or data[1] & ~EXCEPTION != request[0]:
            raise Malformed(
                f"device {data[0]}, function {data[1]}; device {device_id}, function {request[0]} are needed"
            )
        if not data[1] & EXCEPTION:
            data += _read(port, 1 + reply_size(request) + 2 - EXCEPTION_FRAME, deadline)
        self._last_input = time.monotonic()
        if crc16(data[:-2]) != data[-2:]:
            raise Malformed(f"CRC {data[-2:].hex()}; {crc16(data[:-2]).hex()} is needed")
        if port.in_waiting:
            raise Malformed(f"{port.in_waiting} bytes after an answer; silence is needed")
        return data[1:-2]


def _read(port: Serial, count: int, deadline: float) -> bytes:
    """``count`` bytes, or :class:`Silence` at the deadline."""
    port.timeout = max(0.0, deadline - time.monotonic())
    data = port.read(count) if count else b""
    if len(data) < count:
        raise Silence
    return data
