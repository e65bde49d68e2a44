"""Exclusive access: a block in which no other process writes to a folder of the archive.

On a disk this is a file lock, which the system releases when a process dies. An object store has no lock, but every client sees
a new object at once. A process that needs a place puts a claim there and then lists the claims: with another live claim beside
its own it removes its own and tries again later. Of two simultaneous processes at least one sees the other, so they never both
continue. A claim is renewed at intervals; a claim that is too old belongs to a dead process. Only the clock of the store is used.
"""

import os
import platform
import random
import threading
import time
import uuid
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import TextIO

from pipelines.archive import files
from pipelines.archive.store import ObjectPath, Place
from schemas import host
from schemas.errors import OperatorNeeded

LEASE_S = 120.0
RENEWAL_S = 30.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.02, 2.0
CLAIM = "claim-"
LOCK = "lock"


@contextmanager
def alone(folder: Place, *, wait: bool = False) -> Generator[None, None, None]:
    """A block in which no other process writes into the folder.

    A capture lasts hours, so a second one is refused; a stage lasts seconds, so a second one waits.
    """
    with _claimed(folder, wait=wait) if isinstance(folder, ObjectPath) else _locked(folder, wait=wait):
        yield


@contextmanager
def _locked(folder: Place, *, wait: bool) -> Generator[None, None, None]:
    while True:
        with _lock_file(folder) as lock:
            try:
                host.lock(lock, host.EXCLUSIVE | (0 if wait else host.AT_ONCE))
            except BlockingIOError:
                raise OperatorNeeded(_busy(folder)) from None
            if not _is_at(lock, str(folder / LOCK)):  # removed meanwhile with its folder, whose files were packed
                continue
            yield
            return


def _lock_file(folder: Place) -> TextIO:
    """The open lock file of a folder; both are made where they do not exist."""
    with files.writing(folder):
        while True:
            folder.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):  # the folder was removed meanwhile
                return open(str(folder / LOCK), "w", encoding="utf-8")  # noqa: PTH123 - the caller closes it


def _is_at(file: TextIO, name: str) -> bool:
    """Whether an open file is still the file of this name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), os.stat(name))  # noqa: PTH116 - as it was opened
    except FileNotFoundError:
        return False


@contextmanager
def _claimed(folder: ObjectPath, *, wait: bool) -> Generator[None, None, None]:
    claim = folder / f"{CLAIM}{platform.node()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    pause, randomly = FIRST_PAUSE_S, random.SystemRandom()
    while True:
        with files.writing(folder):
            claim.write_bytes(b"")
        if not _others(folder, claim):
            break
        claim.unlink(missing_ok=True)
        if not wait and pause > 20.0 * FIRST_PAUSE_S:  # two simultaneous processes both step back: try a few times
            raise OperatorNeeded(_busy(folder))
        time.sleep(pause * randomly.uniform(0.5, 1.5))
        pause = min(2.0 * pause, LONGEST_PAUSE_S)
    over = threading.Event()
    keeper = threading.Thread(target=_renew, args=(claim, over), daemon=True)
    keeper.start()
    try:
        yield
    finally:
        over.set()
        keeper.join()
        claim.unlink(missing_ok=True)


def _others(folder: ObjectPath, claim: ObjectPath) -> list[ObjectPath]:
    """Live claims of other processes; dead ones are removed."""
    now = claim.stat().st_mtime
    claims: list[ObjectPath] = []
    for other in folder.iterdir():
        if not other.name.startswith(CLAIM) or other == claim:
            continue
        try:
            age = now - other.stat().st_mtime
        except FileNotFoundError:  # released in the meantime
            continue
        if age > LEASE_S:
            other.unlink(missing_ok=True)
        else:
            claims.append(other)
    return claims


def _renew(claim: ObjectPath, over: threading.Event) -> None:
    while not over.wait(RENEWAL_S):
        with suppress(OSError):  # the store may be unreachable for a moment; the next renewal is in time
            claim.write_bytes(b"")


def _busy(folder: Place) -> str:
    return f"capture: another process is measuring this lot into {folder}; wait for it, or stop it"
