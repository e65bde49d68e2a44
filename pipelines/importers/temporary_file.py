"""A temporary file, for libraries that read from a path only."""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator


@contextmanager
def as_file(data: bytes, suffix: str) -> Generator[Path]:
    """The path of a temporary file with the bytes."""
    with tempfile.TemporaryDirectory(prefix="tumbleline-") as folder:
        path = Path(folder) / f"recording{suffix}"
        path.write_bytes(data)
        yield path
