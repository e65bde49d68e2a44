"""Reading of a person's file in a separate process, with limits of memory and time: one mechanism for commands and pages.

A file decides what its parser does. One that never returns, or takes more memory than the machine has, ends with its process
and is refused in a sentence. The process is started at the first file, reused for the next, and ends with its parent process.
"""

import atexit
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from pipelines.importers import limited_process
from schemas.errors import DataRejected
from schemas.host import resource

Given = ParamSpec("Given")
Result = TypeVar("Result")

MIB = 2**20
ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "ARROW_IO_THREADS": "1",
    "MALLOC_ARENA_MAX": "2",
    "ARROW_DEFAULT_MEMORY_POOL": "system",
}
"""Address space that libraries reserve and a reader does not need would count as memory of the file: 1 GB for Arrow's pool."""
PROGRAM = "from pipelines.importers.limited_process import main; main()"


class ReadingEnded(DataRejected):
    """A file whose reading reached a limit."""


@dataclass(frozen=True)
class ReadingLimits:
    """Limits of one reading: bytes beyond those of the idle process, seconds of the processor, seconds of the clock."""

    memory_bytes: int
    processor_s: int
    clock_s: int


def limits_for(size: int) -> ReadingLimits:
    """The limits of a command for a file of this many bytes: a measured record of text takes 15 times its size, and 0.3 s/MB."""
    seconds = 60 + 2 * size // 10**6
    installed = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 2**40
    return ReadingLimits(min(1024 * MIB + 40 * size, installed), seconds, 3 * seconds)


class _Reader:
    def __init__(self) -> None:
        # -P and the path of this process: a module in the folder of the recordings is never imported
        environment = os.environ | ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self._socket, theirs = socket.socketpair()
        self._stream = self._socket.makefile("rwb")
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 - this interpreter and a module of the product
                [sys.executable, "-P", "-c", PROGRAM, str(theirs.fileno())], pass_fds=[theirs.fileno()], env=environment,
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip

    def ask(self, request: tuple[Any, ...], clock_s: float, where: str) -> tuple[str, Any, bool]:
        """The answer: its kind, its content, and whether the process ends with it."""
        self._socket.settimeout(clock_s)
        try:
            limited_process.send(self._stream, request)
            return cast("tuple[str, Any, bool]", limited_process.value_of(limited_process.received(self._stream)))
        except (ConnectionError, EOFError):
            status = self._process.wait()
        except TimeoutError:
            raise ReadingEnded(
                f"{where}: not read after {clock_s:.0f} s, a recording of its size takes a fraction of that; export it as CSV"
            ) from None
        over = status == -getattr(signal, "SIGXCPU", 0)
        found = f"not read after {request[2]} s of the processor" if over else f"its reader was ended (status {status})"
        raise ReadingEnded(f"{where}: {found}, a recording that can be read is needed; export it as CSV")

    def end(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.wait()
        with suppress(OSError):  # a request that the process did not take
            self._stream.close()
        self._socket.close()


def _reads_itself() -> bool:
    """Whether this process reads: it is the reader, or the system has no limits for one."""
    return limited_process.is_reader() or resource is None


_lock = threading.Lock()
_idle: list[_Reader] = []


def start() -> None:
    """Start the process, so that it imports its libraries while this process imports its libraries."""
    with _lock:
        if not _idle and not _reads_itself():
            _idle.append(_Reader())


def in_reader(
    limits: ReadingLimits, where: str, function: Callable[Given, Result], *given: Given.args, **named: Given.kwargs
) -> Result:
    """The result of a function of this product in the process of the reader; one at a time.

    Parameters
    ----------
    function : importable by its name; its arguments and result can be pickled.

    Raises
    ------
    DataRejected
        The limits were reached.
    TumblelineError
        Of the function.
    """
    if _reads_itself():
        return function(*given, **named)
    with _lock:
        reader, last = _idle.pop() if _idle else _Reader(), True
        try:
            request = (str(Path.cwd()), limits.memory_bytes, limits.processor_s, function, given, named)
            kind, content, last = reader.ask(request, limits.clock_s, where)
        finally:
            if last:
                reader.end()
            else:
                _idle.append(reader)
    if kind == "memory":
        raise ReadingEnded(
            f"{where}: reading it takes more than {limits.memory_bytes // MIB} MB of memory; divide the recording into several "
            "files, or leave out columns"
        )
    if kind == "problem":
        raise content
    return cast("Result", content)


@atexit.register
def end() -> None:
    """End the idle process."""
    while _idle:
        _idle.pop().end()
