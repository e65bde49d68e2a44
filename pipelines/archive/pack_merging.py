"""Merging of packs: the number of packs grows with the months of an archive, not with its compactions.

The newest packs of a month, or of the ledger, become one where an older one is at most twice as large as all newer ones
together, so that a file is written again only when its pack grows by half. The merged pack names those that it replaces; when it
is published they are removed, and after a killed compaction by the next one.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from pipelines.archive import derived, files, packs
from pipelines.archive.hash_chain import is_number
from pipelines.archive.pack_writing import LARGEST, FolderToPack, write_pack
from schemas.errors import ArchiveUnusable

RATIO = 2  # a pack stays by itself when it is more than so many times larger than all newer ones of its month together
PAUSE_S = 0.05  # between new pack and removal: a folder's time of change tells readers, and its clock is coarse


def merge_packs(root: Path) -> dict[str, list[str]]:
    """Merge what is due; the zips that each new one replaced, by its name.

    Only for the holder of the lock of the packs.
    """
    done: dict[str, list[str]] = {}
    by_what: dict[str, list[Path]] = {}
    for one in packs.Packs(root).contents():
        by_what.setdefault(one.pack.stem[7:], []).append(one.pack)
    for what, own in sorted(by_what.items()):
        due = due_of([place.stat().st_size for place in own])
        if due > 1:
            merged = _merged(root, what, own[-due:])
            if merged:
                done[merged] = [place.name for place in own[-due:]]
    return done


def due_of(sizes: Sequence[int]) -> int:
    """How many of the newest packs are to be merged, of packs with these sizes in bytes, oldest first."""
    total, count = 0, 0
    for size in reversed(sizes):
        if count and (size > RATIO * total or total + size > LARGEST):
            break
        total, count = total + size, count + 1
    return count


def remove_replaced(root: Path) -> None:
    """Remove the packs that a later one replaces: a compaction was killed after it had merged them."""
    top = root / packs.FOLDER
    for one in packs.Packs(root).contents():
        if derived.unframed(one.place)[1] == derived.EDITED:
            continue
        older = [str(name) for name in one.about().get("replaced", [])]
        _remove(top, [name for name in older if is_number(name[:6]) and int(name[:6]) < int(one.place.name[:6])])


def _merged(root: Path, what: str, own: Sequence[Path]) -> str:
    """One pack in place of some of one month; empty where later packs have all their files."""
    known, top = packs.Packs(root), root / packs.FOLDER
    tables = [one for one in known.contents() if one.pack in own]
    names: dict[str, int] = {}  # with the last change of the folder before it was packed
    for one in tables:
        if files.sha256(one.pack) != one.about().get("sha256"):
            raise ArchiveUnusable(
                f"archive compact: {one.pack} has changed since it was made; restore it from a copy (new files are packed, no "
                "pack was removed)"
            )
        for name, folder in one.folders():
            names[name] = max(names.get(name, 0), folder.mtime_ns)
    held: dict[tuple[str, str], packs.Member] = {}
    portion = list[FolderToPack]()
    for name, mtime_ns in names.items():
        current = known.folder(name)
        inside = {} if current is None else {file: one for file, one in current.files.items() if one.pack in own}
        held |= {(name, file): one for file, one in inside.items()}
        if inside:
            portion.append(
                FolderToPack(name, mtime_ns, {file: (one.size, one.mtime_ns) for file, one in inside.items()})
            )
    if not portion:
        return ""
    replaced = [place.name for place in own]
    merged = write_pack(root, what, portion, lambda folder, file: packs.read(held[folder, file]), replaced)
    time.sleep(PAUSE_S)
    _remove(top, replaced)
    return merged


def _remove(top: Path, zips: Sequence[str]) -> None:
    """Remove packs: each table of contents first, without which its zip is nothing."""
    for name in zips:
        place = top / name
        if packs.NAME.fullmatch(place.stem) and place.suffix == packs.CONTAINER:
            place.with_suffix(packs.CONTENTS).unlink(missing_ok=True)
            place.unlink(missing_ok=True)
