"""The devices of a simulated station and their client on one processor.

Both are threads of one interpreter and take turns at every message. On two processors each turn has to wake the other one, which
on a virtual machine takes longer than the message itself.
"""

import fcntl
import os
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

_NAME = "tumbleline-{user}-processor-{number}.lock"


@contextmanager
def one_processor() -> Generator[None]:
    """A block whose thread, and those that it starts, stay on a processor that no other such block of the user has.

    Nothing changes where no processor is free, or where the system cannot tie a thread to one.
    """
    with ExitStack() as stack:
        number = _claimed(stack)
        if number is not None:
            before = os.sched_getaffinity(0)
            _tie(number)
            stack.callback(_tie, *before)
        yield


def _tie(*numbers: int) -> None:
    """Let this thread run on some processors; it stays where it is when they are no longer its own (a changed cpuset)."""
    with suppress(OSError):
        os.sched_setaffinity(0, numbers)


def _claimed(stack: ExitStack) -> int | None:
    """A processor that is claimed until the stack is left, also by a kill; None where all have been or there is but one."""
    if not hasattr(os, "sched_setaffinity") or len(allowed := os.sched_getaffinity(0)) < 2:
        return None
    for number in sorted(allowed):
        place = Path(tempfile.gettempdir()) / _NAME.format(user=os.getuid(), number=number)
        try:
            file = os.open(place, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        except OSError:
            return None
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # another block has it
            os.close(file)
            continue
        stack.callback(os.close, file)
        return number
    return None
