"""The readers of files: each is one module of this package and is discovered here.

A module states ``NAME`` (of the format in the archive), ``TITLE`` (for people), ``EXTRA`` (the optional dependency that
it needs, or empty), ``ORDER`` (order in which readers are tried), ``recognised`` and ``read``.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Protocol, cast

from pipelines.importers.content import Content


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


def _readers_by_name() -> dict[str, FileReader]:
    modules = [cast("FileReader", import_module(f"{__name__}.{info.name}")) for info in iter_modules(__path__)]
    return {module.NAME: module for module in sorted(modules, key=lambda one: one.ORDER)}


READERS: dict[str, FileReader] = _readers_by_name()
"""By name, in the order in which they are tried."""


def reader_of(data: bytes) -> FileReader:
    """The reader that recognises a file by its first bytes; delimited text if no other does."""
    return next(reader for reader in READERS.values() if reader.recognised(data))
