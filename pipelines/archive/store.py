"""Where an archive lies: a local folder, or a path of any file system that Arrow knows (``s3://bucket/folder?…``).

A local archive is :class:`pathlib.Path` throughout, at no cost. :class:`ObjectPath` answers to the same few methods for an
object store, where putting an object is atomic by itself and folders exist only as beginnings of names.
"""

from __future__ import annotations

import io
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any, TypeAlias

from schemas.errors import ArchiveUnusable

REMEDY = "check the address, the credentials and the network"


@dataclass(frozen=True)
class Size:
    """The ``stat`` of an object: its bytes, and when it was written, seconds since 1970 on the clock of the store."""

    st_size: int
    st_mtime: float


class ObjectPath:
    """A path in an object store, with the methods of :class:`pathlib.Path` that the archive uses.

    system : the file system of pyarrow.
    key : bucket and key, with slashes.
    scheme : begins the path as people read it.
    address : the archive's whole address as it was given.
    """

    def __init__(self, system: Any, key: str, scheme: str, address: str) -> None:
        self.system, self.scheme, self.address = system, scheme, address
        self.pure = PurePosixPath(key)
        self.key, self.name, self.stem, self.suffix = str(self.pure), self.pure.name, self.pure.stem, self.pure.suffix

    def __truediv__(self, other: str) -> ObjectPath:
        return self._at(self.pure / other)

    def __str__(self) -> str:
        return f"{self.scheme}://{self.key}"

    def __repr__(self) -> str:
        return f"ObjectPath({str(self)!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ObjectPath) and (self.address, self.key) == (other.address, other.key)

    def __hash__(self) -> int:
        return hash((self.address, self.key))

    def __lt__(self, other: ObjectPath) -> bool:
        return self.key < other.key

    @property
    def parent(self) -> ObjectPath:
        """The path above."""
        return self._at(self.pure.parent)

    def is_file(self) -> bool:
        """Whether an object has this name."""
        return self._info().type.name == "File"

    def is_dir(self) -> bool:
        """Whether there are objects below this path."""
        return self._info().type.name == "Directory"

    def exists(self) -> bool:
        """Whether there is anything here."""
        return self._info().type.name != "NotFound"

    def stat(self) -> Size:
        """Size and age of an object."""
        info = self._info()
        if info.type.name != "File":
            raise FileNotFoundError(str(self))
        return Size(info.size, info.mtime_ns / 1e9)

    def read_bytes(self) -> bytes:
        """The whole object."""
        with self._reached(), self.system.open_input_file(self.key) as stream:
            return stream.read()

    def read_text(self, encoding: str = "utf-8") -> str:
        """The whole object as text."""
        return self.read_bytes().decode(encoding)

    def open(self, mode: str = "rb") -> io.BytesIO:
        """The object's bytes as a stream that can be read."""
        if mode != "rb":
            raise io.UnsupportedOperation(mode)
        return io.BytesIO(self.read_bytes())

    def write_bytes(self, data: bytes) -> int:
        """Write the object completely or not at all; the number of its bytes."""
        with self.system.open_output_stream(self.key) as stream:  # the caller reports errors of the system
            stream.write(data)
        return len(data)

    def unlink(self, *, missing_ok: bool = False) -> None:
        """Remove the object."""
        with self._reached():
            try:
                self.system.delete_file(self.key)
            except FileNotFoundError:
                if not missing_ok:
                    raise

    def remove_all(self) -> None:
        """Remove all objects below this path."""
        with self._reached():
            self.system.delete_dir(self.key)

    def mkdir(self, *, parents: bool = False, exist_ok: bool = False) -> None:
        """Nothing: folders need not be made."""

    def resolve(self) -> ObjectPath:
        """The path itself: an object store has no links."""
        return self

    def iterdir(self) -> Iterator[ObjectPath]:
        """Paths directly below, in no particular order."""
        return iter(self._listed(recursive=False))

    def walk(self) -> Iterator[ObjectPath]:
        """Every object below, at any depth."""
        return iter(self._listed(recursive=True))

    def glob(self, pattern: str) -> Iterator[ObjectPath]:
        """Paths below that match a pattern; each part of the pattern is one level."""
        return globbed(self, pattern)

    def _at(self, pure: PurePosixPath) -> ObjectPath:
        return ObjectPath(self.system, str(pure), self.scheme, self.address)

    def _info(self) -> Any:
        with self._reached():
            return self.system.get_file_info(self.key)

    def _listed(self, *, recursive: bool) -> list[ObjectPath]:
        from pyarrow.fs import FileSelector

        with self._reached():
            infos = self.system.get_file_info(FileSelector(self.key, allow_not_found=True, recursive=recursive))
        selected = [info for info in infos if not recursive or info.type.name == "File"]
        return [self._at(PurePosixPath(info.path)) for info in selected if info.path.rstrip("/") != self.key]

    @contextmanager
    def _reached(self) -> Generator[None, None, None]:
        try:
            yield
        except FileNotFoundError:
            raise
        except OSError as problem:
            raise ArchiveUnusable(
                f"archive: {self} cannot be reached ({first_line(problem)}), a store that answers is needed; {REMEDY}"
            ) from None


def globbed(folder: Any, pattern: str) -> Iterator[Any]:
    """Paths below a folder that match a pattern; each part of the pattern is one level."""
    first, _, rest = pattern.partition("/")
    matches = [folder / first]
    if any(mark in first for mark in "*?["):
        inside = folder.iterdir() if folder.is_dir() else ()
        matches = sorted(path for path in inside if fnmatchcase(path.name, first))
    for path in matches:
        if rest:
            yield from path.glob(rest)
        elif path.exists():
            yield path


Place: TypeAlias = Path | ObjectPath


def path_of(address: str | Path | ObjectPath) -> Place:
    """The folder, or the path in an object store, that an address names."""
    if isinstance(address, ObjectPath | Path):
        return address
    if "://" not in address:
        return Path(address)
    scheme = address.partition("://")[0]
    if scheme == "file":
        return Path(address.removeprefix("file://"))
    import pyarrow as pa
    from pyarrow.fs import FileSystem

    try:
        system, key = FileSystem.from_uri(address)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError, OSError) as problem:
        shown = _without_secrets(address)
        raise ArchiveUnusable(
            f"archive: address '{shown}' cannot be used ({first_line(problem).replace(address, shown)}), a folder or an address "
            "such as s3://bucket/folder?endpoint_override=host:port&scheme=http is needed; correct it"
        ) from None
    return ObjectPath(system, key, scheme, address)


def address_of(path: Place) -> str:
    """An address by which another process finds the same archive."""
    return path.address if isinstance(path, ObjectPath) else str(path.resolve())


def first_line(problem: Exception) -> str:
    """The first line of the message of an exception."""
    text = getattr(problem, "strerror", None) or str(problem) or type(problem).__name__
    return str(text).splitlines()[0]


def _without_secrets(address: str) -> str:
    """The address without the credentials that may stand before its host."""
    scheme, _, rest = address.partition("://")
    authority, slash, path = rest.partition("/")
    return f"{scheme}://{authority.rpartition('@')[2]}{slash}{path}"
