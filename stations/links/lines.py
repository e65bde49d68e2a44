"""Lines of text over TCP: a question or an order, one line back."""

from __future__ import annotations

import socket
import time
from typing import TYPE_CHECKING

from schemas.errors import LinkLost, StationRefused, StationTimeout
from stations.links.wires import drop_what_is_late

if TYPE_CHECKING:
    from collections.abc import Callable

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
        """The answer to a question; after a time-out or a loss it is put again on a fresh connection."""
        for attempt in range(1, self._attempts + 1):
            try:
                return self._exchange(question, what)
            except (StationTimeout, LinkLost):
                if attempt == self._attempts:
                    raise
        raise StationTimeout(
            f"{self._where}: no attempt to ask '{question}' was allowed; set read_attempts to 1 or more"
        )

    def tell(self, order: str, what: str, *, before: Callable[[], None] | None = None) -> str:
        """The answer to an order, sent once: after a failure it is unknown whether the device acted."""
        return self._exchange(order, what, before)

    def close(self) -> None:
        """Ends the connection."""
        if self._socket is not None:
            self._socket.close()  # what could not be sent is dropped with it
        self._socket = None

    def _exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The line that comes back. A line has no number, so a connection whose answer is late or strange is not used again."""
        asked = f"{what} '{line}'"
        try:
            answer = self._spoken(line, before)
        except TimeoutError:
            self.close()
            raise StationTimeout(
                f"{self._where}: no answer to {asked} in {self._timeout:g} s; check device and cable"
            ) from None
        except OSError as problem:
            self.close()
            raise LinkLost(
                f"{self._where}: connection lost at {asked} ({problem}), a listening device is needed; check power"
            ) from None
        if answer.startswith(REFUSED):
            raise StationRefused(
                f"{self._where}: {asked} was answered with '{answer}'; check the device and its profile"
            )
        return answer

    def _spoken(self, line: str, before: Callable[[], None] | None) -> str:
        deadline = time.monotonic() + self._timeout
        if self._socket is None:
            self._socket = socket.create_connection(self._address, self._timeout)
            drop_what_is_late(self._socket, self._timeout)
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
