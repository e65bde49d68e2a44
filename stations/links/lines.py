"""Text lines: a query or a command, and one line as the answer; over TCP, or over another wire for lines."""

import socket
import time
from collections.abc import Callable
from contextlib import suppress

from schemas.errors import LinkLost, StationRefused, StationTimeout
from stations.links.wires import Broken, LineWire, Silence, discard_undelivered

END = b"\r\n"
REFUSED = "NA:"
LONGEST = 1024
CHUNK = 256


class LineLink:
    """One device with a text protocol, on a wire that connects at its first use and again after a lost connection."""

    def __init__(self, wire: LineWire, *, read_attempts: int) -> None:
        self._wire = wire
        self._attempts = read_attempts

    def ask(self, question: str, what: str) -> str:
        """The answer to a query; after a time-out or a lost connection the query is repeated on a new connection."""
        for _ in range(self._attempts - 1):
            with suppress(StationTimeout, LinkLost):
                return self._exchange(question, what)
        return self._exchange(question, what)

    def tell(self, order: str, what: str, *, before: Callable[[], None] | None = None) -> str:
        """The answer to a command, sent once: after a failure it is unknown whether the device acted."""
        return self._exchange(order, what, before)

    def close(self) -> None:
        """Ends the connection."""
        self._wire.close()

    def _exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The answer line. A line has no number, so a connection with a late or malformed answer is not used again."""
        request = f"{what} '{line}'"
        try:
            answer = self._wire.exchange(line, what, before)
        except Silence:
            raise StationTimeout(
                f"{self._wire.where}: no answer to {request} in {self._wire.timeout_s:g} s; check device and cable"
            ) from None
        except Broken as problem:
            raise LinkLost(
                f"{self._wire.where}: connection lost at {request} ({problem}), a listening device is needed; check power"
            ) from None
        if answer.startswith(REFUSED):
            raise StationRefused(
                f"{self._wire.where}: the answer to {request} is '{answer}'; check the device and its profile"
            )
        return answer


class TcpLines:
    """Lines over TCP, each ended by carriage return and line feed."""

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        self.where = f"{host}:{port}"
        self.timeout_s = timeout_s
        self._address = (host, port)
        self._socket: socket.socket | None = None

    def exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The answer to a line; a connection without a valid one is closed."""
        try:
            return self._converse(line, before)
        except TimeoutError:
            self.close()
            raise Silence from None
        except OSError as problem:
            self.close()
            raise Broken(str(problem)) from None

    def close(self) -> None:
        """Ends the connection."""
        if self._socket is not None:
            self._socket.close()  # undelivered bytes are discarded
        self._socket = None

    def _converse(self, line: str, before: Callable[[], None] | None) -> str:
        deadline = time.monotonic() + self.timeout_s
        if self._socket is None:
            self._socket = socket.create_connection(self._address, self.timeout_s)
            discard_undelivered(self._socket, self.timeout_s)
        if before is not None:
            before()
        self._socket.sendall(line.encode("ascii") + END)
        data = b""
        while not data.endswith(END):
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise TimeoutError
            self._socket.settimeout(left)
            more = self._socket.recv(CHUNK)
            if not more or len(data) > LONGEST:
                raise ConnectionError("closed by the device" if not more else "a line without an end")
            data += more
        text = data[: -len(END)]
        if END in text or not text.isascii():
            raise ConnectionError(f"{text!r} is not one line")
        return text.decode("ascii")
