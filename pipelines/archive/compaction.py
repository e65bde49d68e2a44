"""Compaction: the files of finished runs, of their captures, and of the ledger go into packs, one for a month and kind.

A pack is written aside, read back and published with its table of contents last; only then the single files are removed,
folder by folder under the folder's lock, and only those that are still as they were packed. A process that is killed at any
time leaves every file at least once; the next compaction removes what lies twice.
"""

import os
import re
import time
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.archive import files, packs
from pipelines.archive.archive import Archive
from pipelines.archive.hash_chain import is_number
from pipelines.archive.locks import LOCK, alone
from pipelines.archive.pack_writing import LARGEST, FolderToPack, merge_packs, remove_replaced, write_pack
from pipelines.archive.records import COMPLETE
from pipelines.archive.run import SEALED, START
from schemas.errors import OperatorNeeded, WrongUse

LEAST_AGE_S = 3600.0  # of an event of the ledger: a process that decides on the next one has read it long ago
LEDGER = "calibrations"
MONTH = re.compile(r"\d{4}-\d{2}")
PAGE = "report.html"  # stays: a browser opens it


@dataclass
class Compacted:
    """The result of a compaction.

    packed, bytes : files that are in packs now and were not before · freed : single files that were removed
    kept : folders with single files that changed, or that another process used, while they were packed
    unfinished : runs that are left as they are
    """

    packs: list[str] = field(default_factory=list[str])
    packed: int = 0
    bytes: int = 0
    freed: int = 0
    kept: list[str] = field(default_factory=list[str])
    unfinished: list[str] = field(default_factory=list[str])


def compact(archive: Archive, before: str = "") -> Compacted:
    """Pack what is finished in a local archive.

    before : only runs that began before this day; all where empty
    Raises WrongUse: the archive is in an object store.
    Raises OperatorNeeded: a run is being measured, or another compaction is active.
    """
    if not isinstance(archive.root, Path):
        raise WrongUse(
            f"archive compact: {archive.root} is an object store, a local archive is needed; a store has no cost for a small "
            "object that a pack would save"
        )
    root, done = Path(str(archive.root)), Compacted()
    with _compacting(root):
        _refuse_open(root)
        files.sweep(root / packs.FOLDER)
        remove_replaced(root)
        for container in (root / packs.FOLDER).glob(f"*{packs.CONTAINER}"):
            if not container.with_suffix(packs.CONTENTS).is_file():  # a compaction was killed before it was there
                container.unlink()
        known = packs.Packs(root)
        months = _runs_by_month(archive, root, before, done)
        for month, folders in sorted(months.items()):
            _pack(root, month, _new(root, known, folders), done)
        _pack(root, LEDGER, _new(root, known, _ledger(root)), done)
        known = packs.Packs(root)
        for name in _below(root, "runs", "captures"):  # also what a killed compaction packed and did not remove
            _free(root, known, name, done)
        with alone(root / LEDGER, wait=True):  # nobody certifies meanwhile
            for name in _ledger(root):
                _free(root, known, name, done)
        for merged, replaced in merge_packs(root).items():
            done.packs = [*(pack for pack in done.packs if pack not in replaced), merged]
    return done


@contextmanager
def _compacting(root: Path) -> Generator[None]:
    """A block in which no other process compacts."""
    held = ExitStack()
    try:
        held.enter_context(alone(root / packs.FOLDER))
    except OperatorNeeded:
        raise OperatorNeeded("archive compact: another process is compacting this archive; wait for its end") from None
    with held:
        yield


def _refuse_open(root: Path) -> None:
    """Refuse while a process measures a lot or computes a run."""
    for kind in ("captures", "runs"):
        for lock in (root / kind).glob(f"*/{LOCK}"):
            try:
                with alone(lock.parent):
                    continue
            except OperatorNeeded:
                raise OperatorNeeded(
                    f"archive compact: {kind}/{lock.parent.name} is being written, an archive without open runs is needed; give "
                    "the command again after its end (nothing was changed)"
                ) from None


def _runs_by_month(archive: Archive, root: Path, before: str, done: Compacted) -> dict[str, list[str]]:
    """Folders of finished runs with single files and of their captures, by the month in which the run began."""
    out: dict[str, list[str]] = {}
    captures: set[str] = set()
    run_names = sorted(folder.name for folder in (root / "runs").iterdir()) if (root / "runs").is_dir() else []
    open_captures = any(_has_single(root / name) for name in _below(root, "captures"))
    for name in run_names:
        if not open_captures and not _has_single(root / "runs" / name):
            continue  # packed but for its page: most runs of an old archive
        if not (archive.root / "runs" / name / START).is_file():
            continue
        about = files.read_json(archive.root / "runs" / name / START)
        began, capture = str(about.get("when", ""))[:10], str(about.get("capture") or "")
        if before and began >= before:
            continue
        if not (archive.root / "runs" / name / SEALED).is_file():
            done.unfinished.append(name)
            continue
        folders = out.setdefault(began[:7] if MONTH.fullmatch(began[:7]) else "undated", [])
        folders.append(f"runs/{name}")
        if capture and capture not in captures and (root / "captures" / capture / COMPLETE).is_file():
            captures.add(capture)
            folders.append(f"captures/{capture}")
    return out


def _below(root: Path, *kinds: str) -> list[str]:
    """Folders that lie by themselves, by their names below the root."""
    tops = ((kind, root / kind) for kind in kinds)
    return [f"{kind}/{folder.name}" for kind, top in tops if top.is_dir() for folder in sorted(top.iterdir())]


def _ledger(root: Path) -> list[str]:
    """Folders of units with calibrations that lie by themselves."""
    top = root / LEDGER
    return sorted(f"{LEDGER}/{shard.name}/{unit}" for shard in top.glob("??") for unit in os.listdir(shard))  # noqa: PTH208 - names


def _new(root: Path, known: packs.Packs, names: Iterable[str]) -> Iterator[FolderToPack]:
    """The folders with files that no pack has as they are; files of killed writers, locks and young events are left out."""
    latest = time.time_ns() - int(LEAST_AGE_S * 1e9)
    for name in names:
        folder = known.folder(name)
        single = dict(_single(root / name))
        if name.startswith(f"{LEDGER}/"):
            single = {
                file: stamp
                for file, stamp in single.items()
                if stamp[1] < latest and is_number(file.removesuffix(".json"))
            }
        packed = {} if folder is None else {file: (entry.size, entry.mtime_ns) for file, entry in folder.files.items()}
        new = {file: stamp for file, stamp in single.items() if packed.get(file) != stamp}
        if new:
            yield FolderToPack(name, (root / name).stat().st_mtime_ns, new)


def _single(folder: Path, prefix: str = "") -> Iterator[tuple[str, tuple[int, int]]]:
    """Names below a folder, with size and time of each file that the archive wrote."""
    with os.scandir(folder) as inside:
        for entry in sorted(inside, key=lambda item: item.name):
            if entry.name.startswith(files.TEMPORARY) or entry.is_symlink() or entry.name in {LOCK, PAGE}:
                continue
            if entry.is_dir():
                yield from _single(Path(entry.path), f"{prefix}{entry.name}/")
            else:
                about = entry.stat()
                yield f"{prefix}{entry.name}", (about.st_size, about.st_mtime_ns)


def _has_single(folder: Path) -> bool:
    return folder.is_dir() and any(True for _ in _single(folder))


def _pack(root: Path, what: str, folders: Iterable[FolderToPack], done: Compacted) -> None:
    """Write packs of the folders, each up to :data:`LARGEST` bytes."""
    rest = iter(folders)
    while portion := _portion(rest):
        done.packs.append(write_pack(root, what, portion, lambda folder, name: (root / folder / name).read_bytes()))
        done.packed += sum(len(folder.files) for folder in portion)
        done.bytes += sum(folder.bytes for folder in portion)


def _portion(folders: Iterator[FolderToPack]) -> list[FolderToPack]:
    """The next folders for one pack."""
    portion, size = list[FolderToPack](), 0
    while size < LARGEST and (folder := next(folders, None)) is not None:
        portion.append(folder)
        size += folder.bytes
    return portion


def _free(root: Path, known: packs.Packs, name: str, done: Compacted) -> None:
    """Remove the single files of a folder that a pack has, with the folder where nothing else is in it."""
    folder, packed = root / name, known.folder(name)
    if packed is None or not folder.is_dir():
        return
    try:
        with nullcontext() if name.startswith(f"{LEDGER}/") else alone(folder):
            left = _remove_packed(folder, packed.files, done)
            if not left:
                (folder / LOCK).unlink(missing_ok=True)
    except OperatorNeeded:
        left = True
    if left and not name.startswith(f"{LEDGER}/"):  # young events stay
        done.kept.append(name)
    for inside in sorted(Path(folder).rglob("*"), reverse=True):
        with suppress(OSError):
            inside.rmdir()
    with suppress(OSError):  # another process has begun to write there
        folder.rmdir()


def _remove_packed(folder: Path, packed: Mapping[str, packs.Member], done: Compacted) -> bool:
    """Remove the files that are as a pack has them; whether another one is left."""
    left = False
    for name, at in list(_single(folder)):
        member = packed.get(name)
        if member is None or (member.size, member.mtime_ns) != at or packs.read(member) != (folder / name).read_bytes():
            left = True
            continue
        (folder / name).unlink()
        done.freed += 1
    return left
