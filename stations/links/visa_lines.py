"""Lines of text to an instrument on VISA: USB, GPIB, LAN (VXI-11, HiSLIP, sockets) or a serial line, through PyVISA.

PyVISA is an extra. ``TUMBLELINE_VISA`` names the VISA library, as PyVISA writes it: ``@py`` (PyVISA-py, the default, which needs
no other program), ``@ivi`` (the maker's library), or a file with ``@sim`` behind it (PyVISA-sim, a second simulator).
"""

import os
import warnings
from collections.abc import Callable
from typing import Any

from schemas.library import library
from stations.links.wires import Broken, Silence

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
                try:
                    thing.close()
                except (pyvisa.errors.Error, OSError):  # it is gone already
                    continue
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
