"""The process that reads files of persons: it takes a function and its arguments, and sends the result or the error.

The limit of memory is beyond what the process has when it begins: libraries take address space too.
"""

import gc
import math
import os
import pickle
import queue
import signal
import socket
import struct
import sys
import threading
import traceback
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from schemas.errors import TumblelineError
from schemas.host import resource

KEPT_BYTES = 192 * 2**20
"""A process that holds more after a reading ends, so that the memory is free again."""
_here: list[bool] = []


def is_reader() -> bool:
    """Whether this is the process that reads."""
    return bool(_here)


def send(sink: Any, value: Any) -> None:
    """A value to the other process; arrays are written from where they are."""
    arrays: list[pickle.PickleBuffer] = []
    head = pickle.dumps(value, 5, buffer_callback=arrays.append)
    pieces: list[Any] = [head, *(array.raw() for array in arrays)]
    sink.write(struct.pack(f">{len(pieces) + 1}Q", len(pieces), *(len(memoryview(piece)) for piece in pieces)))
    for piece in pieces:
        sink.write(piece)
    sink.flush()


def received(source: Any) -> list[bytearray]:
    """The pieces of a value from the other process; arrays lie where they are received."""
    (count,) = struct.unpack(">Q", _exactly(source, 8))
    sizes = struct.unpack(f">{count}Q", _exactly(source, 8 * count))
    return [_exactly(source, size) for size in sizes]


def _exactly(source: Any, count: int) -> bytearray:
    piece = bytearray(count)
    if source.readinto(piece) < count:
        raise EOFError
    return piece


def value_of(pieces: list[bytearray]) -> Any:
    """The value in received pieces."""
    head, *arrays = pieces
    return pickle.loads(head, buffers=arrays)  # noqa: S301 - from a process of this program


def main() -> None:
    """Read until the other process ends; its end also ends a reading."""
    _here.append(True)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other process decides
    stream = socket.socket(fileno=int(sys.argv[1])).makefile("rwb")
    requests: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(stream, requests), daemon=True).start()
    import_module("pipelines.importers.readers")  # while the other process prepares its first request

    while True:
        # a request imports the module of its function: only here, where no other import is under way
        request = value_of(requests.get())
        kind, content = _done(*request)
        gc.collect()
        last = kind == "memory" or _pages(1) > KEPT_BYTES
        try:
            send(stream, (kind, content, last))
        except MemoryError:
            send(stream, ("memory", None, True))
        del request, content
        if last:
            return


def _listen(source: Any, requests: queue.SimpleQueue[Any]) -> None:
    """Pass requests on; the process ends where there is nobody who asks."""
    with suppress(EOFError, OSError):
        while True:
            requests.put(received(source))
    os._exit(0)


def _done(
    folder: str, memory: int, seconds: int, function: Callable[..., Any], given: Any, named: Any
) -> tuple[str, Any]:
    try:
        os.chdir(folder)
        _limit(memory, seconds)
        return "done", function(*given, **named)
    except MemoryError:
        return "memory", None
    except TumblelineError as problem:
        return "problem", problem.with_traceback(None)
    except Exception as problem:  # noqa: BLE001 - a defect: raised again in the process that asked, with its place
        problem.add_note(traceback.format_exc())
        with suppress(Exception):
            pickle.loads(pickle.dumps(problem))  # noqa: S301 - whether it can be sent
            return "problem", problem
        return "problem", RuntimeError(f"{type(problem).__name__}: {problem}")
    finally:
        for kind in (resource.RLIMIT_AS, resource.RLIMIT_CPU):
            hard = resource.getrlimit(kind)[1]
            resource.setrlimit(kind, (hard, hard))


def _limit(memory: int, seconds: int) -> None:
    """Limits of the next reading, within those of the process."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    for kind, value in (
        (resource.RLIMIT_AS, _pages(0) + memory),
        # the system counts whole seconds: a limit rounded down would leave a reading of one second no time at all
        (resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime) + seconds),
    ):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


@contextmanager
def reserving(size: int) -> Generator[None]:
    """A block with more address space, for a library that reserves many bytes and uses few; without limits it does nothing."""
    limits = resource.getrlimit(resource.RLIMIT_AS) if is_reader() else (resource.RLIM_INFINITY,) * 2
    if limits[0] == resource.RLIM_INFINITY:
        yield
        return
    soft, hard = limits
    wider = soft + size
    resource.setrlimit(resource.RLIMIT_AS, (wider if hard == resource.RLIM_INFINITY else min(wider, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)


def _pages(column: int) -> int:
    """Bytes of this process: 0 of address space, 1 of memory; 0 where the system does not say."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[column]) * resource.getpagesize()
    return 0
