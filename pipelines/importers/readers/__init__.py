"""The readers of files: each module of this package is a reader, and is discovered here.

A module states ``NAME`` (of the format in the archive), ``TITLE`` (for people), ``EXTRA`` (the optional dependency that
it needs, or empty), ``ORDER`` (order in which readers are tried), ``recognised`` and ``read``.
"""

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from typing import Protocol, cast

from pipelines.importers.content import Content

NEEDED = ("NAME", "TITLE", "EXTRA", "ORDER", "recognised", "read")


class FileReader(Protocol):
    """A module that reads one format."""

    NAME: str
    TITLE: str
    EXTRA: str
    ORDER: int

    def recognised(self, data: bytes) -> bool:
        """Whether the first bytes of a file are those of this format."""
        ...

    def read(self, name: str, data: bytes, group: str) -> Content:
        """The table of a file.

        Parameters
        ----------
        name : of the file, for messages.
        group : the group of channels, if a file has several; empty otherwise.
        """
        ...


class IncompleteReader(Exception):
    """A module that is half a reader, or has the name or the order of another: its author must correct it."""


def find_readers(package: str, path: Iterable[str]) -> dict[str, FileReader]:
    """The readers that the modules of a package define, by name in the order in which they are tried.

    Raises
    ------
    IncompleteReader
        Modules lack something of :class:`FileReader`, or two have one name or order; all that is missing is listed.
    """
    missing: list[str] = []
    readers: list[FileReader] = []
    for info in iter_modules(path):
        module = import_module(f"{package}.{info.name}")
        lacking = [name for name in NEEDED if not hasattr(module, name)]
        if lacking:
            missing.append(f"{info.name}: no {', '.join(lacking)}")
            continue
        reader = cast("FileReader", module)
        if any(reader.NAME == other.NAME or reader.ORDER == other.ORDER for other in readers):
            missing.append(f"{info.name}: NAME '{reader.NAME}' or ORDER {reader.ORDER} is that of another reader")
        readers.append(reader)
    if missing:
        raise IncompleteReader(f"{package}: {'; '.join(missing)}")
    return {reader.NAME: reader for reader in sorted(readers, key=lambda reader: reader.ORDER)}


READERS: dict[str, FileReader] = find_readers(__name__, __path__)
"""By name, in the order in which they are tried."""


def reader_of(data: bytes) -> FileReader:
    """The reader that recognises a file by its first bytes; delimited text if no other does."""
    return next(reader for reader in READERS.values() if reader.recognised(data))
