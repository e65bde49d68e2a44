"""Optional libraries of single formats: imported when such a file is read, with a message how to install them."""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.errors import WrongUse

if TYPE_CHECKING:
    from collections.abc import Generator


def library(module: str, extra: str, where: str) -> Any:
    """The module of an optional library.

    Raises
    ------
    WrongUse
        It is not installed; the message has the command that installs it.
    """
    try:
        return import_module(module)
    except ImportError:
        raise WrongUse(
            f"{where}: needs the library {module}, which is not installed; install it with: "
            f"pip install 'tumbleline[{extra}]'"
        ) from None


@contextmanager
def as_file(data: bytes, suffix: str) -> Generator[Path]:
    """A temporary file with the bytes, for libraries that read from a path only."""
    with tempfile.TemporaryDirectory(prefix="tumbleline-") as folder:
        path = Path(folder) / f"recording{suffix}"
        path.write_bytes(data)
        yield path
