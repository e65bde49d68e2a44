"""Packs: many small files of an archive in one file each, read in place.

``packed/<number>-<what>.zip`` holds files uncompressed, ``<number>-<what>.toc`` its table of contents: a line with the
seal, a line about the zip, then a line for each folder (of a run, of a capture, of a unit's calibrations) with the place,
size and time of every file. A pack counts when both exist. It is never changed, but may be replaced by one of a higher number
that has all its files; where two packs have the same file, that of the higher number counts. Any program that unpacks zip files
restores the single files.
"""

import json
import mmap
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple, cast

from schemas.errors import ArchiveUnusable

FOLDER = "packed"
CONTENTS, CONTAINER = ".toc", ".zip"
NAME = re.compile(r"\d{6}-[0-9a-z-]+")
FOLDERS_OF = {"runs": 2, "captures": 2, "calibrations": 3}  # parts of the name of a folder that is packed as a whole
TICK_NS = 2_000_000_000
LATELY = 256  # folders whose contents stay in memory
LISTINGS = 16  # of the folder while another process merges packs
SEARCHED = 4  # look-ups in a table before the offsets of its folders stay in memory
BEGINNING = re.compile(rb'\n\{"folder":("(?:[^"\\]|\\.)*")')


class Member(NamedTuple):
    """A file in a pack: the zip, the offset of its bytes there, and the time of its last change, ns since 1970."""

    pack: Path
    offset: int
    size: int
    mtime_ns: int


@dataclass(frozen=True)
class PackedFolder:
    """The packed files of a folder by their names below it.

    mtime_ns : time of the last change of the folder before it was packed, ns since 1970
    """

    mtime_ns: int
    files: Mapping[str, Member]


class Contents:
    """The table of contents of one pack, searched where it lies."""

    def __init__(self, path: Path) -> None:
        self.path, self.pack, self.identity = path, path.with_suffix(CONTAINER), identity_of(path)
        self._asked, self._starts = 0, cast("dict[bytes, int] | None", None)
        with path.open("rb") as file:
            self._lines = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    def folder(self, name: str) -> PackedFolder | None:
        """A folder; None where the pack does not have it.

        The first few are searched for, then the table is read once for the places of all: many questions would read it each.
        """
        if self._starts is None and self._asked < SEARCHED:
            self._asked += 1
            start = self._lines.find(b'\n{"folder":' + _text(name) + b",")
        else:
            if self._starts is None:
                self._starts = {match.group(1): match.start() for match in BEGINNING.finditer(self._lines)}
            start = self._starts.get(_text(name), -1)
        return None if start < 0 else self._at(start + 1)[1]

    def folders(self) -> Iterator[tuple[str, PackedFolder]]:
        """Every folder with its name, in the order of the pack."""
        for match in BEGINNING.finditer(self._lines):
            yield self._at(match.start() + 1)

    def names(self) -> Iterator[str]:
        """Names of the folders."""
        for match in BEGINNING.finditer(self._lines):
            yield json.loads(match.group(1))

    def about(self) -> dict[str, Any]:
        """The line about the zip: its hash and its size."""
        start = self._lines.find(b"\n") + 1
        return json.loads(self._lines[start : self._lines.find(b"\n", start)])

    def _at(self, start: int) -> tuple[str, PackedFolder]:
        try:
            line = json.loads(self._lines[start : self._lines.find(b"\n", start)])
            files = {name: Member(self.pack, *where) for name, where in line["files"].items()}
            return line["folder"], PackedFolder(line["mtime_ns"], files)
        except (ValueError, KeyError, TypeError, AttributeError):
            raise ArchiveUnusable(
                f"archive: {self.path} is damaged, the table of contents of a pack is needed; restore it from a copy"
            ) from None


class Packs:
    """All packs of a local archive; packs that another process makes are seen at the next question.

    root : folder of the archive
    """

    def __init__(self, root: Path) -> None:
        self.root, self.top = root, Path(root).absolute() / FOLDER
        self._stamp, self._known, self._lock = 0, list[Contents](), Lock()
        self._folders: dict[str, PackedFolder | None] = {}  # asked for lately

    def contents(self, kind: str = "") -> list[Contents]:
        """The tables of contents, oldest first.

        kind : ``calibrations``, or another first part of a name: those that may have such folders; empty: all
        """
        for _ in range(LISTINGS):
            try:
                stamp = self.top.stat().st_mtime_ns
            except OSError:
                return []
            if stamp == self._stamp:
                break
            with self._lock, suppress(FileNotFoundError):  # packs are merged at this moment
                self._folders.clear()
                known = {table.identity: table for table in self._known}
                paths = sorted(path for path in self.top.iterdir() if _is_contents(path))
                self._known = [known.get(identity_of(path)) or Contents(path) for path in paths]
                if self.top.stat().st_mtime_ns == stamp:
                    # a change within the same tick of the clock leaves the time as it is
                    self._stamp = stamp if time.time_ns() - stamp > TICK_NS else 0
                    break
        if not kind:
            return self._known
        ledger = kind == "calibrations"
        return [table for table in self._known if table.path.stem.endswith("-calibrations") == ledger]

    def folder(self, name: str) -> PackedFolder | None:
        """The packed files of a folder; None where no pack has it.

        name : below the root, with slashes, such as ``runs/line-six-0123456789``
        """
        tables = self.contents(name.partition("/")[0])
        if name not in self._folders:
            parts = [part for table in tables if (part := table.folder(name))]
            if len(self._folders) >= LATELY:
                self._folders.clear()
            self._folders[name] = _together(parts) if parts else None
        return self._folders.get(name)

    def folders(self, kind: str) -> dict[str, PackedFolder]:
        """All packed folders of a kind (``runs``, ``captures``, ``calibrations``), each by its name below the root."""
        out: dict[str, PackedFolder] = {}
        for contents in self.contents(kind):
            for name, folder in contents.folders():
                if name.startswith(f"{kind}/"):
                    out[name] = _together([out[name], folder]) if name in out else folder
        return out

    def below(self, name: str) -> set[str]:
        """First parts of the names of what lies below a folder that is not packed as a whole, such as ``runs``."""
        start = f"{name}/"
        names = (path for contents in self.contents(name.partition("/")[0]) for path in contents.names())
        return {path.removeprefix(start).partition("/")[0] for path in names if path.startswith(start)}


def read_together(members: Mapping[str, Member]) -> dict[str, bytes]:
    """The bytes of files of a folder, by name, in one read for each pack: a disk reads on faster than it seeks."""
    out: dict[str, bytes] = {}
    for pack in {member.pack for member in members.values()}:
        inside = {name: member for name, member in members.items() if member.pack == pack}
        start = min(member.offset for member in inside.values())
        end = max(member.offset + member.size for member in inside.values())
        block = memoryview(read(Member(pack, start, end - start, 0)))
        out |= {
            name: bytes(block[member.offset - start : member.offset - start + member.size])
            for name, member in inside.items()
        }
    return out


def identity_of(path: Path) -> tuple[str, int, int]:
    """Name, inode and time of change: they tell a file from another of the same name, as after a restored archive."""
    about = path.stat()
    return path.name, about.st_ino, about.st_mtime_ns


def read(member: Member) -> bytes:
    """The bytes of a packed file.

    Raises OSError: the zip is not there or ends before the file does.
    """
    with member.pack.open("rb", buffering=0) as file:
        file.seek(member.offset)
        data = file.read(member.size)
    if len(data) != member.size:
        raise OSError(f"{member.pack} is truncated")
    return data


def read_current(ask: Callable[[], Member | None]) -> bytes | None:
    """The bytes of a packed file, wherever it lies now; None where no pack has it.

    ask : where it lies; asked again where its pack was merged with others since the answer
    """
    for left in reversed(range(LISTINGS)):
        member = ask()
        if member is None:
            return None
        try:
            return read(member)
        except FileNotFoundError:
            if not left:
                raise
    return None


def split(name: str) -> tuple[str, str] | None:
    """The folder that is packed as a whole and the rest, of a name below the root; None above such folders."""
    parts = name.split("/")
    count = FOLDERS_OF.get(parts[0], 0)
    return ("/".join(parts[:count]), "/".join(parts[count:])) if 0 < count <= len(parts) else None


def line_of(folder: str, mtime_ns: int, files: Mapping[str, tuple[int, int, int]]) -> bytes:
    """The line of a folder in a table of contents; ``files``: offset, size and time of each."""
    listed = json.dumps({name: list(where) for name, where in files.items()}, separators=(",", ":"))
    return b'{"folder":' + _text(folder) + f',"mtime_ns":{mtime_ns},"files":{listed}}}\n'.encode()


def _text(name: str) -> bytes:
    return json.dumps(name).encode()


def _is_contents(path: Path) -> bool:
    named = path.suffix == CONTENTS and NAME.fullmatch(path.stem) is not None
    return named and path.with_suffix(CONTAINER).is_file() and path.stat().st_size > 0


def _together(parts: list[PackedFolder]) -> PackedFolder:
    """A folder of several packs, the newest last."""
    files = {name: member for part in parts for name, member in part.files.items()}
    return PackedFolder(max(part.mtime_ns for part in parts), files)
