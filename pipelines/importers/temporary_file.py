"""A temporary file, for libraries that read from a path only."""

from __future__ import annotations

import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

HANDLES = Path("/proc/self/fd")


@contextmanager
def as_file(data: bytes, suffix: str) -> Generator[Path]:
    """The path of a temporary file with the bytes.

    Where the system gives open files a path, it has no other: nothing is left of it, also when the process is killed.
    """
    if HANDLES.is_dir():
        with tempfile.TemporaryFile(prefix="tumbleline-") as file:
            file.write(data)
            file.flush()
            yield HANDLES / str(file.fileno())
        return
    with tempfile.TemporaryDirectory(prefix="tumbleline-") as folder:
        path = Path(folder) / f"recording{suffix}"
        path.write_bytes(data)
        yield path
