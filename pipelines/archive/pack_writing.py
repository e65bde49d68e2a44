"""Writing and merging of packs: the zip aside, synchronised and read back, then published; its table of contents last.

The number of packs grows with the months of an archive, not with its compactions: the newest packs of a month, or of the ledger,
become one where an older one is at most twice as large as all newer ones together, so that a file is written again only when its
pack grows by half. The merged pack names those that it replaces; when it is published they are removed, and after a killed
compaction by the next one.
"""

import hashlib
import os
import time
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

    root : folder of the archive
    what : end of its name: a month, or ``calibrations``
    replaced : zips of packs whose files are all in this one; from now on they may be removed
    """
    top = root / packs.FOLDER
    numbers = [int(path.name[:6]) for path in top.glob(f"*{packs.CONTENTS}") if is_number(path.name[:6])]
    name = f"{max(numbers, default=0) + 1:06d}-{what}"
    temporary, container = top / f"{files.TEMPORARY}{name}", top / f"{name}{packs.CONTAINER}"
    with files.writing(top, "archive compact", "make room; nothing was removed"):
        try:
            lines, total = _filled(temporary, portion, read)
            temporary.replace(container)
        finally:
            temporary.unlink(missing_ok=True)
    about: dict[str, Any] = {"zip": container.name, "sha256": total, "bytes": container.stat().st_size}
    about |= {"replaced": list(replaced)} if replaced else {}
    content = b" ".join(files.json_bytes(about).split()) + b"\n" + b"".join(lines)
    files.publish(top / f"{name}{packs.CONTENTS}", derived.framed(content), "archive compact")
    return container.name


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


RATIO = 2  # a pack stays by itself when it is more than so many times larger than all newer ones of its month together
PAUSE_S = 0.05  # between new pack and removal: a folder's time of change tells readers, and its clock is coarse


def merge_packs(root: Path) -> dict[str, list[str]]:
    """Merge the packs that are due; the names of the zips that were replaced, by the name of the new zip.

    Only for the holder of the lock of the packs.
    """
    done: dict[str, list[str]] = {}
    by_what: dict[str, list[Path]] = {}
    for table in packs.Packs(root).contents():
        by_what.setdefault(table.pack.stem[7:], []).append(table.pack)
    for what, paths in sorted(by_what.items()):
        due = due_of([path.stat().st_size for path in paths])
        if due > 1:
            merged = _merged_pack(root, what, paths[-due:])
            if merged:
                done[merged] = [path.name for path in paths[-due:]]
    return done


def due_of(sizes: Sequence[int]) -> int:
    """The number of the newest packs to be merged, of packs with these sizes in bytes, oldest first."""
    total, count = 0, 0
    for size in reversed(sizes):
        if count and (size > RATIO * total or total + size > LARGEST):
            break
        total, count = total + size, count + 1
    return count


def remove_replaced(root: Path) -> None:
    """Remove the packs that a later one replaces: a compaction was killed after it had merged them."""
    top = root / packs.FOLDER
    for table in packs.Packs(root).contents():
        if derived.unframed(table.path)[1] == derived.EDITED:
            continue
        older = [str(name) for name in table.about().get("replaced", [])]
        _remove_packs(top, [name for name in older if is_number(name[:6]) and int(name[:6]) < int(table.path.name[:6])])


def _merged_pack(root: Path, what: str, paths: Sequence[Path]) -> str:
    """Merge packs of a month; the name of the new zip, empty where later packs have all their files."""
    known, top = packs.Packs(root), root / packs.FOLDER
    tables = [table for table in known.contents() if table.pack in paths]
    names: dict[str, int] = {}  # with the last change of the folder before it was packed
    for table in tables:
        if files.sha256(table.pack) != table.about().get("sha256"):
            raise ArchiveUnusable(
                f"archive compact: {table.pack} has changed since it was made; restore it from a copy (new files are packed, no "
                "pack was removed)"
            )
        for name, folder in table.folders():
            names[name] = max(names.get(name, 0), folder.mtime_ns)
    held: dict[tuple[str, str], packs.Member] = {}
    portion = list[FolderToPack]()
    for name, mtime_ns in names.items():
        current = known.folder(name)
        inside = (
            {} if current is None else {file: member for file, member in current.files.items() if member.pack in paths}
        )
        held |= {(name, file): member for file, member in inside.items()}
        if inside:
            sizes = {file: (member.size, member.mtime_ns) for file, member in inside.items()}
            portion.append(FolderToPack(name, mtime_ns, sizes))
    if not portion:
        return ""
    replaced = [path.name for path in paths]
    merged = write_pack(root, what, portion, lambda folder, file: packs.read(held[folder, file]), replaced)
    time.sleep(PAUSE_S)
    _remove_packs(top, replaced)
    return merged


def _remove_packs(top: Path, zips: Sequence[str]) -> None:
    """Remove packs: each table of contents first, without which its zip is nothing."""
    for name in zips:
        container = top / name
        if packs.NAME.fullmatch(container.stem) and container.suffix == packs.CONTAINER:
            container.with_suffix(packs.CONTENTS).unlink(missing_ok=True)
            container.unlink(missing_ok=True)
