"""Copy of an archive to another disk or an object store, also during runs, and its restoration.

Files of an archive are written once, so a repeated copy adds only new files. The chain is read first and copied last: every file
that an entry of the copy names was copied before it. Files that the chain does not name yet (a lot that is being measured) are
copied in their present state and completed by the next copy. Derived files (``index/``) are left out; they are made again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from pipelines.archive import files
from pipelines.archive.files import TEMPORARY
from schemas.errors import ArchiveUnusable, WrongUse

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pipelines.archive import Archive
    from pipelines.archive.store import Place

CHAIN, INDEX, MARK = "chain", "index", "archive.json"
STATE = "state"  # of a capture: its one file is replaced with every record
WRITTEN_ONCE = ".parquet"  # such a file is there or not; others are compared byte for byte


@dataclass
class Copied:
    """Result of a copy: files that were copied, their size in bytes, files that were there already."""

    files: int = 0
    bytes: int = 0
    present: int = 0


def copy_archive(source: Archive, target: Archive) -> Copied:
    """Copy the files that the target does not have yet.

    Parameters
    ----------
    target : an empty or new folder, or an earlier copy of this archive

    Raises
    ------
    WrongUse
        The target is the source, or lies in it.
    ArchiveUnusable
        The target holds something else, or an archive with another chain; a file was read differently than it was written.
    """
    source.refuse_none()
    _refuse_itself(source, target)
    entries = _names(source.root / CHAIN, CHAIN)
    target.prepare()
    _refuse_another(source, target, entries)
    copied = Copied()
    for name in _names(source.root, ""):
        if name not in entries and not name.startswith(f"{CHAIN}/") and name != MARK:
            _copy(source.root, target.root, name, copied)
    for name in sorted(entries):
        _copy(source.root, target.root, name, copied)
    _drop_old_states(source.root, target.root)
    return copied


def _names(folder: Place, prefix: str) -> set[str]:
    """Names, below the root, of the files of a folder that are copied."""
    found: set[str] = set()
    for path, name in _walk(folder, prefix):
        parts = PurePosixPath(name).parts
        if parts[0] != INDEX and not any(part.startswith(TEMPORARY) for part in parts):
            found.add(name)
        del path
    return found


def _walk(folder: Place, prefix: str) -> Iterator[tuple[Place, str]]:
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        name = f"{prefix}/{path.name}" if prefix else path.name
        if path.is_dir():
            yield from _walk(path, name)
        else:
            yield path, name


def _copy(source: Place, target: Place, name: str, copied: Copied) -> None:
    """Copy a file unless it is there; one that vanished meanwhile (a state, a temporary file) is left out."""
    there, place = source / name, target / name
    try:
        if place.is_file() and _same(there, place, name):
            copied.present += 1
            return
        data = there.read_bytes()
    except FileNotFoundError:
        return
    files.publish(place, data)
    if files.sha256(place) != files.hash_of(data):
        raise ArchiveUnusable(f"backup: {place} was read differently than it was written; check the disk of the copy")
    copied.files += 1
    copied.bytes += len(data)


def _same(there: Place, place: Place, name: str) -> bool:
    if there.stat().st_size != place.stat().st_size:
        return False
    return name.endswith(WRITTEN_ONCE) or files.sha256(there) == files.sha256(place)


def _refuse_itself(source: Archive, target: Archive) -> None:
    root, place = source.root, target.root
    inside = isinstance(root, Path) and isinstance(place, Path) and place.resolve().is_relative_to(root.resolve())
    if inside or str(root) == str(place):
        raise WrongUse(f"backup: {place} lies in the archive {root}, another disk or store is needed; name one")


def _refuse_another(source: Archive, target: Archive, entries: set[str]) -> None:
    """Refuse a target whose chain is not the beginning of that of the source: a copy of another archive, or a newer one."""
    for name in sorted(_names(target.root / CHAIN, CHAIN)):
        if name not in entries or files.sha256(source.root / name) != files.sha256(target.root / name):
            raise ArchiveUnusable(
                f"backup: {target.root} has the entry {name} of a chain that {source.root} does not have, an earlier copy of "
                "this archive or an empty folder is needed; name another, and run 'tumbleline verify' on both"
            )


def _drop_old_states(source: Place, target: Place) -> None:
    """Remove checkpoints from the copy that later ones have replaced, as the capture itself does."""
    captures = target / "captures"
    for capture in captures.iterdir() if captures.is_dir() else ():
        for old in (capture / STATE).glob("*.bin") if (capture / STATE).is_dir() else ():
            if not (source / "captures" / capture.name / STATE / old.name).is_file():
                old.unlink(missing_ok=True)
