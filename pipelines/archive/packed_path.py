"""Paths of a local archive that also find files in packs.

A file that lies by itself is used as it is; only where there is none the packs are asked. So writers and locks work as with
:class:`pathlib.Path`, and readers do not see whether a file is packed. A pack is published before the single files are
removed, and a file lies in both for a while: what lists a folder looks at the single files first.

The functions of :mod:`os` stand here where the methods of a path would ask the packs again.
"""
# ruff: noqa: PTH100, PTH110, PTH114, PTH115, PTH116, PTH120, PTH123, PTH208

import io
import os
from collections.abc import Generator
from errno import EBADF, ELOOP, ENOENT, ENOTDIR
from functools import cache
from pathlib import Path
from stat import S_IFDIR, S_IFREG, S_ISDIR, S_ISREG
from typing import TYPE_CHECKING, Any, ClassVar

from pipelines.archive import packs
from pipelines.archive.names import LinkInArchive
from pipelines.archive.store import Place, globbed

if TYPE_CHECKING:
    Base = Path
else:
    Base = type(Path())  # before Python 3.12 only the class of the system can be derived from


class PackedPath(Base):
    """A path in a local archive with packs; each archive has its own class, so that every derived path knows its packs."""

    known: ClassVar[packs.Packs]
    __slots__ = ()

    def __reduce__(self) -> tuple[Any, ...]:
        return overlay, (str(self.known.root), str(self))

    def stat(self, *, follow_symlinks: bool = True) -> os.stat_result:
        """Size and time; those before packing of a packed file or folder."""
        try:
            return os.stat(self, follow_symlinks=follow_symlinks)
        except (FileNotFoundError, NotADirectoryError):
            packed = self._packed()
            if isinstance(packed, packs.Member):
                return _stated(S_IFREG | 0o444, packed.size, packed.mtime_ns)
            if packed is not None:
                return _stated(S_IFDIR | 0o555, 0, packed)
            raise

    def exists(self, *, follow_symlinks: bool = True) -> bool:
        """Whether there is anything here, by itself or packed."""
        return self._mode(follow_symlinks=follow_symlinks) is not None or self._packed() is not None

    def is_file(self, **_: bool) -> bool:
        """Whether a file is here, by itself or packed."""
        mode = self._mode()
        return isinstance(self._packed(), packs.Member) if mode is None else S_ISREG(mode)

    def is_dir(self, **_: bool) -> bool:
        """Whether a folder is here, by itself or with packed files."""
        mode = self._mode()
        return isinstance(self._packed(), int) if mode is None else S_ISDIR(mode)

    def _mode(self, *, follow_symlinks: bool = True) -> int | None:
        """The mode of an unpacked file or folder at this path, None for none; a folder without permission is an error."""
        try:
            return os.stat(self, follow_symlinks=follow_symlinks).st_mode
        except OSError as problem:
            if problem.errno in {ENOENT, ENOTDIR, EBADF, ELOOP}:
                return None
            raise

    def open(self, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        """The file, for reading also from a pack; one behind a symbolic link is refused."""
        self._refuse_link()
        try:
            return open(self, mode, *arguments, **options)
        except (FileNotFoundError, NotADirectoryError):
            packed = packs.read_current(self._member) if mode in {"r", "rb"} else None
            if packed is None:
                raise
            data = io.BytesIO(packed)
            return data if mode == "rb" else io.TextIOWrapper(data, options.get("encoding") or "utf-8")

    def read_bytes(self) -> bytes:
        """The whole file."""
        with self.open("rb") as file:
            return file.read()

    def read_text(self, encoding: str | None = None, errors: str | None = None, newline: str | None = None) -> str:
        """The whole file as text."""
        with io.TextIOWrapper(io.BytesIO(self.read_bytes()), encoding or "utf-8", errors, newline) as file:
            return file.read()

    def iterdir(self) -> Generator[Any, None, None]:
        """Paths directly below, packed or not, in no particular order; refused behind a symbolic link."""
        self._refuse_link()
        try:
            names = set(os.listdir(self))
        except FileNotFoundError:
            names = self._packed_names()
            if not names:
                raise
        else:
            names |= self._packed_names()
        yield from [self / name for name in names]

    def glob(self, pattern: str | os.PathLike[str], **options: Any) -> Generator[Any, None, None]:
        """Paths below that match a pattern; with packs each part of the pattern is one level."""
        pattern = str(pattern)  # from Python 3.13 on rglob gives a path
        if "**" in pattern or not self.known.contents():
            yield from super().glob(pattern, **options)
        else:
            yield from globbed(self, pattern)

    def _below_root(self) -> str:
        """The name below the root of the archive, with slashes; empty for the root and outside."""
        name = str(self)
        for root in (str(self.known.root), str(self.known.top.parent)):
            if name.startswith(f"{root}/"):
                return name[len(root) + 1 :]
        return name if str(self.known.root) == "." and not name.startswith("/") else ""

    def _refuse_link(self) -> None:
        """Refuse a symbolic link on the way from a top folder, which may lead to another disk, to this path."""
        levels, path = self._below_root().count("/"), str(self)
        for _ in range(levels):
            if os.path.islink(path):
                raise LinkInArchive(
                    f"archive: {path} is a symbolic link to {os.readlink(path)[:200]}, what it leads to is no part of the "
                    "archive and is not read; replace it by the content, or remove it"
                )
            path = os.path.dirname(path)

    def _packed(self) -> packs.Member | int | None:
        """The packed file of this name, or the time of the packed folder; None where no pack has it."""
        name = self._below_root()
        if not name or not self.known.contents():
            return None
        parts = packs.split(name)
        if parts is None:
            return 0 if self.known.below(name) else None
        folder, rest = parts
        packed = self.known.folder(folder)
        if packed is None:
            return None
        if rest in packed.files:
            return packed.files[rest]
        return packed.mtime_ns if not rest or any(file.startswith(f"{rest}/") for file in packed.files) else None

    def _member(self) -> packs.Member | None:
        """The packed file of this name; None where no pack has it."""
        packed = self._packed()
        return packed if isinstance(packed, packs.Member) else None

    def _packed_names(self) -> set[str]:
        name = self._below_root()
        if not name or not self.known.contents():
            return set()
        parts = packs.split(name)
        if parts is None:
            return self.known.below(name)
        packed = self.known.folder(parts[0])
        start = f"{parts[1]}/" if parts[1] else ""
        members = packed.files if packed is not None else ()
        return {file[len(start) :].partition("/")[0] for file in members if file.startswith(start)}


def overlay(root: str, path: str = "") -> Path:
    """A path of an archive, by default its root, that also finds what is packed there."""
    return _class_of(root, os.path.abspath(root))(path or root)


def with_packs(root: Place) -> Place:
    """The root of an archive that also finds what is packed there; an object store has no packs."""
    return overlay(str(root)) if isinstance(root, Path) and not isinstance(root, PackedPath) else root


def member_of(path: object) -> packs.Member | None:
    """The packed file at a path where no file lies by itself; None for any other path."""
    if not isinstance(path, PackedPath) or os.path.exists(path):
        return None
    return path._member()  # noqa: SLF001 - the question of this module


@cache
def _class_of(root: str, _absolute: str) -> type[PackedPath]:
    return type("PackedPath", (PackedPath,), {"known": packs.Packs(Path(root)), "__slots__": ()})


def _stated(mode: int, size: int, mtime_ns: int) -> os.stat_result:
    seconds = mtime_ns / 1e9
    whole = int(seconds)
    times = {"st_atime": seconds, "st_mtime": seconds, "st_ctime": seconds}
    named = {**times, "st_atime_ns": mtime_ns, "st_mtime_ns": mtime_ns, "st_ctime_ns": mtime_ns}
    return os.stat_result((mode, 0, 0, 1, 0, 0, size, whole, whole, whole), named)
