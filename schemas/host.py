"""What differs between operating systems: locks on files and folders, limits of a process, who owns a file.

Linux and macOS have all of it. Windows has locks on files, none on folders and no limits of a process: the desk side (read, fit,
diagnose, report, workbench) works there without them.
"""

import os
import socket
import sys
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import IO, Any


def _module(name: str) -> Any:
    """A module of the standard library that some systems lack; None where it is missing."""
    try:
        return import_module(name)
    except ImportError:
        return None


_fcntl, _termios, resource = _module("fcntl"), _module("termios"), _module("resource")
_msvcrt: Any = None if _fcntl else _module("msvcrt")
SHARED, EXCLUSIVE, AT_ONCE = (1, 2, 4)
"""Ways to lock a file; ``EXCLUSIVE | AT_ONCE`` does not wait."""


def lock(file: int | IO[Any], way: int) -> None:
    """Lock an open file until it is closed; the system releases the lock of a process that dies.

    Raises
    ------
    BlockingIOError
        Another process holds it, and :data:`AT_ONCE` was asked.
    OSError
        The file system has no locks.
    """
    handle = file if isinstance(file, int) else file.fileno()
    if _fcntl is not None:
        ways = ((SHARED, _fcntl.LOCK_SH), (EXCLUSIVE, _fcntl.LOCK_EX), (AT_ONCE, _fcntl.LOCK_NB))
        _fcntl.flock(handle, sum(flag for bit, flag in ways if way & bit))
    elif _msvcrt is not None:  # a shared lock is exclusive there
        try:
            _msvcrt.locking(handle, _msvcrt.LK_NBLCK if way & AT_ONCE else _msvcrt.LK_LOCK, 1)
        except PermissionError as problem:
            raise BlockingIOError(*problem.args) from None


@contextmanager
def opened_folder(folder: Path | str) -> Generator[int | None]:
    """The handle of a folder, to lock it or write it to the disk; None where the system opens no folders."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except PermissionError:
        if sys.platform != "win32":
            raise
        yield None
        return
    try:
        yield handle
    finally:
        os.close(handle)


def unsent_bytes(connection: socket.socket) -> int:
    """Bytes that the system holds and the other side has not taken; 0 where the system does not tell."""
    if _fcntl is None or _termios is None:
        return 0
    try:
        return int.from_bytes(_fcntl.ioctl(connection, _termios.TIOCOUTQ, bytes(4)), sys.byteorder)
    except (OSError, ValueError):
        return 0


def most_files() -> float:
    """Files that this process may have open at once."""
    if resource is None:
        return 512.0  # of the C library of Windows
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return float("inf") if files == resource.RLIM_INFINITY else float(files)


def user_id() -> int:
    """Who runs this process; 0 where files have no owner by number."""
    return os.getuid() if hasattr(os, "getuid") else 0
