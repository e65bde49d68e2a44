"""Text lines over TCP: a query or a command, and one line as the answer."""

import socket
import time
from collections.abc import Callable
from contextlib import suppress

from schemas.errors import LinkLost, StationRefused, StationTimeout
from stations.links.wires import discard_undelivered

END = b"\r\n"
REFUSED = "NA:"
LONGEST = 1024
CHUNK = 256


class LineLink:
    """One device with a text protocol; connected at its first use and again after a lost connection."""

    def __init__(self, host: str, port: int, *, timeout_s: float, read_attempts: int) -> None:
        self._where = f"{host}:{port}"
        self._address = (host, port)
        self._timeout = timeout_s
        self._attempts = read_attempts
        self._socket: socket.socket | None = None

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
        if self._socket is not None:
            self._socket.close()  # undelivered bytes are discarded
        self._socket = None

    def _exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The answer line. A line has no number, so a connection with a late or malformed answer is not used again."""
        request = f"{what} '{line}'"
        try:
            answer = self._converse(line, before)
        except TimeoutError:
            self.close()
            raise StationTimeout(
                f"{self._where}: no answer to {request} in {self._timeout:g} s; check device and cable"
            ) from None
        except OSError as problem:
            self.close()
            raise LinkLost(
                f"{self._where}: connection lost at {request} ({problem}), a listening device is needed; check power"
            ) from None
        if answer.startswith(REFUSED):
            raise StationRefused(
                f"{self._where}: the answer to {request} is '{answer}'; check the device and its profile"
            )
        return answer

    def _converse(self, line: str, before: Callable[[], None] | None) -> str:
        deadline = time.monotonic() + self._timeout
        if self._socket is None:
            self._socket = socket.create_connection(self._address, self._timeout)
            discard_undelivered(self._socket, self._timeout)
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
