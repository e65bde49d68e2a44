"""Text lines: a query or a command, and one line as the answer; over TCP, or over VISA (USB, GPIB, LAN, a serial line).

PyVISA is an extra. ``TUMBLELINE_VISA`` names the VISA library, as PyVISA writes it: ``@py`` (PyVISA-py, the default, which needs
no other program), ``@ivi`` (the maker's library), or a file with ``@sim`` behind it (PyVISA-sim, a second simulator).
"""

import os
import socket
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from schemas.errors import LinkLost, StationRefused, StationTimeout
from schemas.library import library
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
        """The answer to a line; a connection without a valid answer is closed."""
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


VARIABLE = "TUMBLELINE_VISA"
DEFAULT = "@py"
NEEDED = "link visa"


class VisaLines:
    """A VISA resource; it is opened at the first line, and again after a failure."""

    def __init__(self, resource: str, timeout_s: float) -> None:
        self.where = resource
        self.timeout_s = timeout_s
        self._pyvisa: Any = None
        self._manager: Any = None
        self._session: Any = None

    def exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The answer to a line."""
        pyvisa = self._pyvisa = self._pyvisa or library("pyvisa", "visa", NEEDED)
        try:
            session = self._opened(pyvisa)
            if before is not None:
                before()
            session.write(line)
            with warnings.catch_warnings(action="error"):  # PyVISA only warns of an answer without its end
                return str(session.read()).rstrip("\r\n")
        except pyvisa.errors.VisaIOError as problem:
            self.close()
            if problem.error_code == pyvisa.constants.StatusCode.error_timeout:
                raise Silence from None
            raise Broken(str(problem.description or problem)) from None
        # an unknown resource, a back end without its library
        except (pyvisa.errors.Error, OSError, ValueError, UserWarning) as problem:
            self.close()
            raise Broken(str(problem)) from None

    def close(self) -> None:
        """Ends the session and its resource manager."""
        pyvisa = self._pyvisa
        for thing in (self._session, self._manager):
            if thing is not None:
                with suppress(pyvisa.errors.Error, OSError):  # it is gone already
                    thing.close()
        self._session = self._manager = None

    def _opened(self, pyvisa: Any) -> Any:
        if self._session is None:
            back_end = os.environ.get(VARIABLE, "") or DEFAULT
            if back_end == DEFAULT:
                library("pyvisa_py", "visa", NEEDED)
            self._manager = pyvisa.ResourceManager(back_end)
            self._session = self._manager.open_resource(self.where)
            if not isinstance(self._session, pyvisa.resources.MessageBasedResource):
                raise ValueError(f"{self.where} is no resource that answers messages")
            self._session.timeout = 1000.0 * self.timeout_s
            self._session.read_termination = self._session.write_termination = "\n"
        return self._session
