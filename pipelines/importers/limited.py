"""Reading of a person's file in a process of its own, with limits of memory and time: one mechanism for commands and pages.

A file decides what its parser does. One that never returns, or takes more memory than the machine has, ends with its process
and is refused in a sentence. The process is started at the first file, kept for the next, and ends with the one that started it.
"""

from __future__ import annotations

import atexit
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from pipelines.importers import limited_process
from schemas.errors import DataRejected

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
    installed = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return ReadingLimits(min(1024 * MIB + 40 * size, installed), seconds, 3 * seconds)


class _Reader:
    """The process that reads."""

    def __init__(self) -> None:
        # -P and the path of this process: a module in the folder of the recordings is never imported
        environment = os.environ | ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self._process = subprocess.Popen(  # noqa: S603 - this interpreter and a module of the product
            [sys.executable, "-P", "-c", PROGRAM],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment,
        )  # fmt: skip

    def ask(self, request: tuple[Any, ...], clock_s: float, where: str) -> tuple[str, Any, bool]:
        """The answer: its kind, its content, and whether the process ends with it."""
        sink, source = self._process.stdin, self._process.stdout
        if sink is None or source is None:
            raise RuntimeError("the process of the reader has no pipes")
        deadline = time.monotonic() + clock_s
        try:
            limited_process.send(sink, request)
            return cast(
                "tuple[str, Any, bool]", limited_process.received(lambda n: _filled(source.fileno(), n, deadline))
            )
        except (BrokenPipeError, EOFError):
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
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                try:
                    stream.close()
                except BrokenPipeError:  # a request that the process did not take
                    continue


_lock = threading.Lock()
_idle: list[_Reader] = []


def start() -> None:
    """Start the process, so that it imports its libraries while this one imports its own."""
    with _lock:
        if not _idle and not limited_process.is_reader():
            _idle.append(_Reader())


def in_reader(
    limits: ReadingLimits, where: str, function: Callable[Given, Result], *given: Given.args, **named: Given.kwargs
) -> Result:
    """The result of a function of this product in the process of the reader; one at a time.

    Parameters
    ----------
    where : the file, for messages.
    function : importable by its name; its arguments and result can be pickled.

    Raises
    ------
    DataRejected
        The limits were reached.
    TumblelineError
        Of the function.
    """
    if limited_process.is_reader():
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


def _filled(handle: int, count: int, deadline: float) -> bytearray:
    """So many bytes of a pipe."""
    content = bytearray(count)
    view, filled = memoryview(content), 0
    waiting = select.poll()
    waiting.register(handle, select.POLLIN)
    while filled < count:
        left = deadline - time.monotonic()
        if left <= 0.0 or not waiting.poll(1000.0 * left):
            raise TimeoutError
        taken = os.readv(handle, [view[filled:]])
        if not taken:
            raise EOFError
        filled += taken
    return content
