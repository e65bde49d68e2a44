"""Remove the temporary files of killed writers, and add finished runs to the chain; files in use are never touched."""

import os
import shutil
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.archive import files, hash_chain, packs
from pipelines.archive.archive import Archive
from pipelines.archive.locks import CLAIM, LEASE_S, alone
from pipelines.archive.provenance import provenance
from pipelines.archive.run import Run
from pipelines.archive.store import ObjectPath, Place
from schemas import host
from schemas.errors import OperatorNeeded

FOLDERS = ("runs", "captures", "calibrations", hash_chain.FOLDER, "index", packs.FOLDER)
AT_ONCE = 1000  # calibrations named by one entry of the chain


@dataclass
class Cleaned:
    """The result of a cleaning.

    removed : paths of the temporary files and folders
    busy : folders that another process writes to; they were not touched
    sealed : finished runs that were missing in the chain and are in it now
    anchored : number of calibrations that were missing in the chain and are in it now
    """

    removed: list[str] = field(default_factory=list[str])
    bytes: int = 0
    busy: list[str] = field(default_factory=list[str])
    sealed: list[str] = field(default_factory=list[str])
    anchored: int = 0


def clean(archive: Archive, *, only_look: bool = False) -> Cleaned:
    """Remove the temporary files of killed writers from an archive.

    only_look : remove nothing and write nothing.
    """
    done = Cleaned()
    for path in list(_left(archive.root)):
        _remove(archive, path, done, only_look=only_look)
    if not only_look:
        _seal(archive, done)
        _anchor(archive, done)
    return done


def _left(root: Place) -> Iterator[Place]:
    """Temporary files and folders, and claims of dead processes."""
    if isinstance(root, ObjectPath):
        claims = [path for path in root.walk() if path.name.startswith(CLAIM)]
        newest = max((claim.stat().st_mtime for claim in claims), default=0.0)
        yield from (claim for claim in claims if newest - claim.stat().st_mtime > LEASE_S)
        return
    for top in (root, *(root / name for name in FOLDERS)):
        for folder, below, names in os.walk(top):
            temporary = [name for name in (*below, *names) if name.startswith(files.TEMPORARY)]
            below[:] = [] if top == root else [name for name in below if name not in temporary]
            yield from (Path(folder) / name for name in sorted(temporary))


def _remove(archive: Archive, path: Place, done: Cleaned, *, only_look: bool) -> None:
    with _owned(archive, path) as mine:
        if not mine:
            done.busy.append(str(path.parent))
            return
        try:
            done.bytes += _size(path)
            if not only_look:
                with files.writing(path):
                    shutil.rmtree(path) if isinstance(path, Path) and path.is_dir() else path.unlink()
        except FileNotFoundError:  # published or removed by another process
            return
        done.removed.append(str(path))


@contextmanager
def _owned(archive: Archive, path: Place) -> Generator[bool, None, None]:
    """Whether no other process writes to the run, the capture or the folder that a path is in."""
    if isinstance(path, ObjectPath):
        yield True
        return
    parts = path.relative_to(str(archive.root)).parts
    with ExitStack() as held:
        if parts[0] in {"runs", "captures"} and len(parts) > 2:
            try:
                held.enter_context(alone(archive.root / parts[0] / parts[1]))
            except OperatorNeeded:
                yield False
                return
        yield held.enter_context(files.writers_of(path.parent, host.EXCLUSIVE | host.AT_ONCE))


def _size(path: Place) -> int:
    if isinstance(path, Path) and path.is_dir():
        return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    return path.stat().st_size


def _seal(archive: Archive, done: Cleaned) -> None:
    """Add finished runs to the chain whose writer was killed before it did so."""
    for name in archive.run_ids():
        run = Run(archive, name)
        if not (run.path / "report.json").is_file() or (run.path / "sealed.json").is_file():
            continue
        try:
            with alone(run.path):
                run.seal()
            done.sealed.append(name)
        except OperatorNeeded:
            done.busy.append(str(run.path))


def _anchor(archive: Archive, done: Cleaned) -> None:
    """Add calibrations to the chain that are missing there."""
    known = hash_chain.sealed_names(archive.root)
    left = [name for name in _calibrations(archive.root) if name not in known]
    for start in range(0, len(left), AT_ONCE):
        part = {name: files.sha256(archive.root / name) for name in left[start : start + AT_ONCE]}
        hash_chain.append(archive.root, "calibrations", part, provenance())
    done.anchored = len(left)


def _calibrations(root: Place) -> Iterator[str]:
    top, length = root / "calibrations", len(str(root))
    paths = top.walk() if isinstance(top, ObjectPath) else sorted(top.glob("*/*/*.json"))
    for path in paths:
        if hash_chain.is_number(path.stem):
            yield str(path)[length:].lstrip(os.sep).replace(os.sep, "/")
