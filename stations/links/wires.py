"""What carries Modbus: TCP and TCP with TLS. A wire sends a request once and gives the answer, or says why not.

Whatever goes wrong, the connection is closed: an answer that comes late must not meet the next question. On TCP the transaction's
number tells too, and it goes on counting over connections, because a gateway may answer the next one with the last one's answer.

One thing keeps its connection: a write without an answer. What is asked next is to find out what became of it, and only on
the same connection can it not overtake the write. Should that be met with silence too, the connection is closed.
"""

from __future__ import annotations

import os
import socket
import ssl
import struct
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from stations.links.frames import WRITES, Malformed

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

HEADER = 7  # transaction, protocol, length, unit (Modbus Messaging on TCP/IP 1.0b, 3.1.3)
LONGEST = 254  # unit and PDU
CHUNK = 4096


class Silence(Exception):
    """Nothing came back in time."""


class Broken(Exception):
    """The connection could not be made, or ended."""


class Wire(Protocol):
    """A way to devices; ``where`` names it in messages, ``timeout_s`` is its patience."""

    where: str
    timeout_s: float

    def exchange(self, device_id: int, request: bytes, before: Callable[[], None] | None = None) -> bytes:
        """The answer to a request, without its envelope; :class:`Silence`, :class:`Broken` or :class:`Malformed`.

        Parameters
        ----------
        before : called when the connection stands and nothing but the sending is left; what it raises leaves the request unsent
        """
        ...

    def close(self) -> None:
        """Ends the connection; the next request makes a new one."""
        ...


class TcpWire:
    """Modbus TCP, over TLS when a context is given; connected when it is first needed and again after it broke."""

    def __init__(
        self, host: str, port: int, timeout_s: float, *, tls: ssl.SSLContext | None = None, server_name: str = ""
    ) -> None:
        self.where = f"{host}:{port}"
        self.timeout_s = timeout_s
        self._address = (host, port)
        self._tls = tls
        self._server_name = server_name or host
        self._socket: socket.socket | None = None
        self._buffer = b""
        self._unsure = False  # the last request was a write, and nothing came back
        self._number = int.from_bytes(os.urandom(2), "big")  # a gateway may still hold what an earlier process asked

    def exchange(self, device_id: int, request: bytes, before: Callable[[], None] | None = None) -> bytes:
        """The answer under this request's number; answers under other numbers are dropped."""
        deadline = time.monotonic() + self.timeout_s
        self._number = self._number % 0xFFFF + 1
        first, self._unsure = not self._unsure, False
        frame = struct.pack(">HHHB", self._number, 0, len(request) + 1, device_id) + request
        try:
            connection = self._connected()
            connection.settimeout(self.timeout_s)
            if before is not None:
                before()
            connection.sendall(frame)
            return self._answer(connection, device_id, deadline)
        except TimeoutError:
            self._unsure = first and request[0] in WRITES and self._socket is not None
            if not self._unsure:
                self._abort()
            raise Silence from None
        except OSError as problem:
            self._abort()
            raise Broken(reason_of(problem)) from None
        except Malformed:
            self._abort()
            raise

    def close(self) -> None:
        """Ends the connection; in peace where every request had its answer."""
        if self._socket is not None and not self._unsure:
            with suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 0, 0))
        self._abort()

    def _abort(self) -> None:
        """Ends the connection; what could not be delivered is dropped."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._buffer, self._unsure = None, b"", False

    def _connected(self) -> socket.socket:
        if self._socket is None:
            plain = socket.create_connection(self._address, self.timeout_s)
            plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            drop_what_is_late(plain, self.timeout_s)
            self._socket = plain
            if self._tls is not None:
                self._socket = self._tls.wrap_socket(plain, server_hostname=self._server_name)
        return self._socket

    def _answer(self, connection: socket.socket, device_id: int, deadline: float) -> bytes:
        while True:
            while (frame := self._frame()) is None:
                left = deadline - time.monotonic()
                if left <= 0.0:
                    raise TimeoutError
                connection.settimeout(left)
                data = connection.recv(CHUNK)
                if not data:
                    raise ConnectionError("closed by the device")
                self._buffer += data
            if int.from_bytes(frame[:2], "big") != self._number:
                continue
            if frame[6] != device_id:
                raise Malformed(f"device {frame[6]}; device {device_id} is needed")
            return frame[HEADER:]

    def _frame(self) -> bytes | None:
        """The next whole frame of the stream; a stream that cannot be one is refused."""
        if len(self._buffer) < HEADER:
            return None
        protocol, length = struct.unpack(">HH", self._buffer[2:6])
        if protocol or not 2 < length <= LONGEST:
            raise Malformed(f"protocol {protocol}, length {length}; protocol 0, length 3 to {LONGEST} are needed")
        end = 6 + length
        if len(self._buffer) < end:
            return None
        frame, self._buffer = self._buffer[:end], self._buffer[end:]
        return frame


def drop_what_is_late(connection: socket.socket, patience_s: float) -> None:
    """Has the system drop what it could not deliver: at the end of the connection, also of the process, and after a while.

    Without this the system goes on delivering for minutes what was sent while the network was away: an order would reach the
    device after the run had given it up, or after a watchdog had made the station safe.
    """
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, max(1, round(1000.0 * patience_s)))


def tls_context(ca: Path, certificate: Path | None = None, key: Path | None = None) -> ssl.SSLContext:
    """A context that trusts this authority alone, checks the name, and shows a certificate where one is given."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.load_verify_locations(ca)
    if certificate is not None:
        context.load_cert_chain(certificate, key)
    return context


def reason_of(problem: Exception) -> str:
    """What a system says went wrong with a connection."""
    if isinstance(problem, ssl.SSLCertVerificationError):
        return f"its certificate does not hold: {problem.verify_message}"
    if isinstance(problem, OSError) and problem.strerror:
        return problem.strerror
    return str(problem)
