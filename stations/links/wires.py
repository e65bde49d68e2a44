"""Wires for Modbus: TCP and TCP with TLS. A wire sends a request once and returns the answer, or raises the reason.

After an error the connection is closed, so that a late answer cannot be mistaken for the answer to the next request. On TCP the
transaction number distinguishes answers too; it continues over connections, because a gateway may send the answer of an earlier
connection on the next one.

Exception: a write without an answer keeps its connection. The next request reads the effect of the write, and only on the same
connection it cannot overtake the write. If that request has no answer either, the connection is closed.
"""

import os
import socket
import ssl
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from stations.links.frames import WRITES, Malformed

HEADER = 7  # transaction, protocol, length, unit (Modbus Messaging on TCP/IP 1.0b, 3.1.3)
LONGEST = 254  # unit and PDU
CHUNK = 4096


class Silence(Exception):
    """No answer arrived in time."""


class Broken(Exception):
    """The connection could not be made, or ended."""


class Unreachable(Broken):
    """No connection could be made."""


class Wire(Protocol):
    """A connection to devices; ``where`` is its name in messages, ``timeout_s`` the longest answer time."""

    where: str
    timeout_s: float

    def exchange(self, device_id: int, request: bytes, before: Callable[[], None] | None = None) -> bytes:
        """The answer to a request, without its envelope; :class:`Silence`, :class:`Broken` or :class:`Malformed`.

        before : called on the open connection immediately before sending; the request is not sent where it raises
        """
        ...

    def close(self) -> None:
        """Ends the connection; the next request connects again."""


class LineWire(Protocol):
    """A connection to a device that answers lines of text."""

    where: str
    timeout_s: float

    def exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The answer to a line, which is sent once; :class:`Silence` or :class:`Broken`. ``what`` is its name in a recording."""
        ...

    def close(self) -> None:
        """Ends the connection; the next line connects again."""


class TcpWire:
    """Modbus TCP, over TLS with a context; it connects at the first request and again after a lost connection."""

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
        self._unanswered_write = False  # the last request was a write without an answer
        self._number = int.from_bytes(os.urandom(2), "big")  # a gateway may still hold requests of an earlier process

    def exchange(self, device_id: int, request: bytes, before: Callable[[], None] | None = None) -> bytes:
        """The answer with the transaction number of this request; other answers are discarded."""
        deadline = time.monotonic() + self.timeout_s
        self._number = self._number % 0xFFFF + 1
        first, self._unanswered_write = not self._unanswered_write, False
        frame = struct.pack(">HHHB", self._number, 0, len(request) + 1, device_id) + request
        try:
            connection = self._connected()
            connection.settimeout(self.timeout_s)
            if before is not None:
                before()
            connection.sendall(frame)
            return self._answer(connection, device_id, deadline)
        except TimeoutError:
            self._unanswered_write = first and request[0] in WRITES and self._socket is not None
            if not self._unanswered_write:
                self._abort()
            raise Silence from None
        except OSError as problem:
            kind = Unreachable if self._socket is None else Broken
            self._abort()
            raise kind(reason_of(problem)) from None
        except Malformed:
            self._abort()
            raise

    def close(self) -> None:
        """Ends the connection, orderly where every request had its answer."""
        if self._socket is not None and not self._unanswered_write:
            with suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 0, 0))
        self._abort()

    def _abort(self) -> None:
        """Ends the connection; undelivered bytes are discarded."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._buffer, self._unanswered_write = None, b"", False

    def _connected(self) -> socket.socket:
        if self._socket is None:
            connection = socket.create_connection(self._address, self.timeout_s)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            discard_undelivered(connection, self.timeout_s)
            self._socket = connection
            if self._tls is not None:
                self._socket = self._tls.wrap_socket(connection, server_hostname=self._server_name)
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
        """The next complete frame of the stream; a stream that is not Modbus TCP is refused."""
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


def discard_undelivered(connection: socket.socket, patience_s: float) -> None:
    """Sets the socket to discard undelivered bytes at the end of the connection or process, and after ``patience_s``.

    Without this the system continues for minutes to deliver bytes that were sent while the network was down: a command would
    reach the device after the run had abandoned it, or after a watchdog had made the station safe.
    """
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, max(1, round(1000.0 * patience_s)))


def tls_context(ca: Path, certificate: Path | None = None, key: Path | None = None) -> ssl.SSLContext:
    """A context that trusts this authority only, checks the host name, and presents the client certificate, if any."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.load_verify_locations(ca)
    if certificate is not None:
        context.load_cert_chain(certificate, key)
    return context


def reason_of(problem: Exception) -> str:
    """The reason of a failed connection, from its exception."""
    if isinstance(problem, ssl.SSLCertVerificationError):
        return f"its certificate is not valid: {problem.verify_message}"
    if isinstance(problem, OSError) and problem.strerror:
        return problem.strerror
    return str(problem)
