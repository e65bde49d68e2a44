"""Taking away what killed writers left, and finishing what they left out of the chain; never what is being written now."""

from __future__ import annotations

import fcntl
import os
import shutil
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.archive import files, hash_chain
from pipelines.archive.locks import CLAIM, LEASE_S, alone
from pipelines.archive.provenance import provenance
from pipelines.archive.run import Run
from pipelines.archive.store import ObjectPath
from schemas.errors import OperatorNeeded

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from pipelines.archive.archive import Archive
    from pipelines.archive.store import Place

FOLDERS = ("runs", "captures", "calibrations", hash_chain.FOLDER, "index")
AT_ONCE = 1000  # calibrations named by one entry of the chain


@dataclass
class Cleaned:
    """What was done.

    removed : places of what was left under temporary names
    busy : folders in which something is being written, left alone
    sealed : runs that were finished and not in the chain
    anchored : how many calibrations were not in the chain
    """

    removed: list[str] = field(default_factory=list[str])
    bytes: int = 0
    busy: list[str] = field(default_factory=list[str])
    sealed: list[str] = field(default_factory=list[str])
    anchored: int = 0


def clean(archive: Archive, *, only_look: bool = False) -> Cleaned:
    """What killed writers left in an archive, taken away.

    Parameters
    ----------
    only_look : take nothing away and write nothing.
    """
    done = Cleaned()
    for place in list(_left(archive.root)):
        _remove(archive, place, done, only_look=only_look)
    if not only_look:
        _seal(archive, done)
        _anchor(archive, done)
    return done


def _left(root: Place) -> Iterator[Place]:
    """What lies under temporary names, and claims of processes that died."""
    if isinstance(root, ObjectPath):
        claims = [place for place in root.walk() if place.name.startswith(CLAIM)]
        newest = max((place.stat().st_mtime for place in claims), default=0.0)
        yield from (place for place in claims if newest - place.stat().st_mtime > LEASE_S)
        return
    for top in (root, *(root / name for name in FOLDERS)):
        for folder, below, names in os.walk(top):
            here = [name for name in (*below, *names) if name.startswith(files.TEMPORARY)]
            below[:] = [] if top == root else [name for name in below if name not in here]
            yield from (Path(folder) / name for name in sorted(here))


def _remove(archive: Archive, place: Place, done: Cleaned, *, only_look: bool) -> None:
    with _owned(archive, place) as mine:
        if not mine:
            done.busy.append(str(place.parent))
            return
        try:
            done.bytes += _size(place)
            if not only_look:
                with files.writing(place):
                    shutil.rmtree(place) if isinstance(place, Path) and place.is_dir() else place.unlink()
        except FileNotFoundError:  # published, or taken away, in the meantime
            return
        done.removed.append(str(place))


@contextmanager
def _owned(archive: Archive, place: Place) -> Generator[bool, None, None]:
    """Whether nobody writes where a place lies: neither a run or capture that is worked on, nor a writer of its folder."""
    if isinstance(place, ObjectPath):
        yield True
        return
    parts = place.relative_to(str(archive.root)).parts
    with ExitStack() as held:
        if parts[0] in {"runs", "captures"} and len(parts) > 2:
            try:
                held.enter_context(alone(archive.root / parts[0] / parts[1]))
            except OperatorNeeded:
                yield False
                return
        yield held.enter_context(files.writers_of(place.parent, fcntl.LOCK_EX | fcntl.LOCK_NB))


def _size(place: Place) -> int:
    if isinstance(place, Path) and place.is_dir():
        return sum(path.stat().st_size for path in place.rglob("*") if path.is_file())
    return place.stat().st_size


def _seal(archive: Archive, done: Cleaned) -> None:
    """Put finished runs into the chain that a killed writer left out."""
    for name in archive.run_ids():
        run = Run(archive, name)
        if not (run.path / "report.json").is_file() or (run.path / "sealed.json").is_file():
            continue
        try:
            with alone(run.path):
                run.seal()
        except OperatorNeeded:
            done.busy.append(str(run.path))
            continue
        done.sealed.append(name)


def _anchor(archive: Archive, done: Cleaned) -> None:
    """Put calibrations into the chain that a killed writer, or a bulk of them, left out."""
    known: set[str] = set()
    for _, place in hash_chain.entries(archive.root):
        if place.is_file():
            known |= files.read_json(place)["files"].keys()
    left = [name for name in _calibrations(archive.root) if name not in known]
    for start in range(0, len(left), AT_ONCE):
        part = {name: files.sha256(archive.root / name) for name in left[start : start + AT_ONCE]}
        hash_chain.append(archive.root, "calibrations", part, provenance())
    done.anchored = len(left)


def _calibrations(root: Place) -> Iterator[str]:
    top, length = root / "calibrations", len(str(root))
    found = top.walk() if isinstance(top, ObjectPath) else sorted(top.glob("*/*/*.json"))
    for place in found:
        if place.stem.isdigit():
            yield str(place)[length:].lstrip(os.sep).replace(os.sep, "/")
