"""Writing of a pack: the zip aside, synchronised and read back, then published; its table of contents last."""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pipelines.archive import derived, files, packs
from pipelines.archive.hash_chain import is_number
from schemas.errors import ArchiveUnusable

Reader = Callable[[str, str], bytes]  # of a file: folder below the root, name below the folder

LARGEST = 2**30  # bytes of one pack: more begins the next, so that a killed compaction has little to do again
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first date of a zip; equal files give equal packs


class FolderToPack(NamedTuple):
    """A folder to pack: its name below the root, time of its last change, and its files with size and time each."""

    name: str
    mtime_ns: int
    files: dict[str, tuple[int, int]]

    @property
    def bytes(self) -> int:
        """Size of its files together."""
        return sum(length for length, _ in self.files.values())


def write_pack(
    root: Path, what: str, portion: Sequence[FolderToPack], read: Reader, replaced: Sequence[str] = ()
) -> str:
    """Write and publish one pack; the name of its zip.

    Parameters
    ----------
    root : folder of the archive
    what : end of its name: a month, or ``calibrations``
    replaced : zips of packs whose files are all in this one; from now on they may be removed
    """
    top = root / packs.FOLDER
    numbers = [int(place.name[:6]) for place in top.glob(f"*{packs.CONTENTS}") if is_number(place.name[:6])]
    name = f"{max(numbers, default=0) + 1:06d}-{what}"
    aside, place = top / f"{files.TEMPORARY}{name}", top / f"{name}{packs.CONTAINER}"
    with files.writing(top, "archive compact", "make room; nothing was removed"):
        try:
            lines, total = _filled(aside, portion, read)
            aside.replace(place)
        finally:
            aside.unlink(missing_ok=True)
    about: dict[str, Any] = {"zip": place.name, "sha256": total, "bytes": place.stat().st_size}
    about |= {"replaced": list(replaced)} if replaced else {}
    content = b" ".join(files.json_bytes(about).split()) + b"\n" + b"".join(lines)
    files.publish(top / f"{name}{packs.CONTENTS}", derived.framed(content), "archive compact")
    return place.name


def _filled(aside: Path, portion: Sequence[FolderToPack], read: Reader) -> tuple[list[bytes], str]:
    """The lines of the table of contents and the hash of the zip, after the zip was read back from the disk's cache."""
    lines, hashes = list[bytes](), list[tuple[int, int, bytes]]()
    with aside.open("xb") as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as container:
        for folder in portion:
            where: dict[str, tuple[int, int, int]] = {}
            for name, (_, mtime_ns) in folder.files.items():
                data = read(folder.name, name)
                container.writestr(zipfile.ZipInfo(f"{folder.name}/{name}", EPOCH), data)
                where[name] = (stream.tell() - len(data), len(data), mtime_ns)
                hashes.append((where[name][0], len(data), hashlib.sha256(data).digest()))
            lines.append(packs.line_of(folder.name, folder.mtime_ns, where))
        container.close()
        stream.flush()
        os.fsync(stream.fileno())
    with aside.open("rb") as stream:
        for offset, size, expected in hashes:
            stream.seek(offset)
            if hashlib.sha256(stream.read(size)).digest() != expected:
                raise ArchiveUnusable(
                    f"archive compact: {aside} was read differently than it was written; check the disk"
                )
    return lines, files.sha256(aside)
