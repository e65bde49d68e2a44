"""The files of runs for the index: sizes, times and content.

An uncached disk serves many requests in the time of one, so files are checked and read by several threads.
"""

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from errno import ELOOP, ENOENT
from pathlib import Path
from typing import NamedTuple

from pipelines.archive.packed_path import PackedPath
from pipelines.archive.packs import PackedFolder, read_together
from pipelines.archive.store import ObjectPath, Place
from schemas.errors import ArchiveUnusable

START = "run.json"
NAMES = ("coefficients", "figures", "grades", "residuals")  # tables that are read
WATCHED = (START, *(f"{name}{end}" for name in NAMES for end in (".json", ".parquet")))
READERS = 8
AT_ONCE = 128  # runs for one task of a thread


class RunFiles(NamedTuple):
    """Files of a run by their names, those of :data:`WATCHED` that exist; ``trouble``: the error where they cannot be read.

    stamp : sizes and times before reading, to detect a change
    """

    run: str
    stamp: str
    content: Mapping[str, bytes]
    trouble: str = ""


def read_runs(runs: Place, stamps: Sequence[tuple[str, str]]) -> Iterator[RunFiles]:
    """The files of runs, in the given order, read ahead by threads.

    Parameters
    ----------
    runs : folder of the runs
    stamps : names of runs, each with its stamp
    """
    with ThreadPoolExecutor(READERS) as pool:
        yield from pool.map(lambda entry: _read(runs / entry[0], entry[1]), stamps)


def stamps_of(root: Place) -> dict[str, str]:
    """Stamps of every run: size and time of each file for the index."""
    runs = root / "runs"
    if isinstance(runs, ObjectPath):
        return _stamps_of_objects(runs)
    if not runs.is_dir():
        return {}
    packed = _packed_marks(root)
    names = sorted({*os.listdir(runs), *packed})  # noqa: PTH208 - ten thousand names, not paths
    groups = [names[k : k + AT_ONCE] for k in range(0, len(names), AT_ONCE)]
    out: dict[str, str] = {}
    with ThreadPoolExecutor(READERS) as pool:
        for stamps in pool.map(lambda group: _stamps(str(runs), group, packed), groups):
            out |= stamps
    return out


def in_order_of_disk(root: Place, runs: Sequence[str]) -> list[str]:
    """Runs in the order in which their files lie: those of the packs by pack, then the others by name."""
    position: dict[str, int] = {}
    for contents in root.known.contents("runs") if isinstance(root, PackedPath) else ():
        for folder in contents.names():
            position[folder.partition("/")[2]] = len(position)
    return sorted(runs, key=lambda run: (position.get(run, len(position)), run))


def stamps_among(root: Path, names: Sequence[str]) -> dict[str, str]:
    """Stamps of some runs of a local archive."""
    folders = {run: root.known.folder(f"runs/{run}") for run in names} if isinstance(root, PackedPath) else {}
    return _stamps(str(root / "runs"), names, {run: _marks(folder) for run, folder in folders.items() if folder})


def _read(path: Place, stamp: str) -> RunFiles:
    content: dict[str, bytes] = {}
    if isinstance(path, Path) and path.is_symlink():
        return RunFiles(path.name, stamp, content, "the folder is a symbolic link, which is not followed")
    single = None
    if isinstance(path, PackedPath) and (folder := path.known.folder(f"runs/{path.name}")) is not None:
        single = set(_names(str(path)))
        packed = {name: folder.files[name] for name in WATCHED if name in folder.files and name not in single}
        try:
            content = read_together(packed)
        except FileNotFoundError:  # its pack was merged with others: file by file, each where it is now
            single = None
        except OSError as trouble:
            return RunFiles(path.name, stamp, content, str(trouble).splitlines()[0])
    for name in WATCHED:
        if name in content or (single is not None and name not in single):
            continue
        try:
            content[name] = _bytes(path, name)
        except FileNotFoundError:
            continue
        except (OSError, ArchiveUnusable) as trouble:
            return RunFiles(path.name, stamp, content, str(trouble).splitlines()[0])
    return RunFiles(path.name, stamp, content)


def _bytes(path: Place, name: str) -> bytes:
    if isinstance(path, Path):
        try:
            with open(f"{path}/{name}", "rb", buffering=0, opener=_no_link) as file:
                return file.readall()
        except OSError as problem:
            if problem.errno not in {ENOENT, ELOOP}:
                raise
    return (path / name).read_bytes()


def _no_link(name: str, flags: int) -> int:
    return os.open(name, flags | os.O_NOFOLLOW)


def _stamps(runs: str, names: Iterable[str], packed: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    out: dict[str, str] = {}
    for run in names:
        also = packed.get(run, {})
        single = _names(f"{runs}/{run}") if also else WATCHED  # a packed run has few or none
        marks = [(_mark(f"{runs}/{run}/{name}") if name in single else "") or also.get(name, "") for name in WATCHED]
        if marks[0]:  # a run without run.json has not started
            out[run] = _short(marks)
    return out


def _packed_marks(root: Place) -> dict[str, dict[str, str]]:
    """Sizes and times of the packed files of runs, as they were before they were packed."""
    out: dict[str, dict[str, str]] = {}
    for contents in root.known.contents("runs") if isinstance(root, PackedPath) else ():
        for folder, packed in contents.folders():
            kind, _, run = folder.partition("/")
            if kind == "runs":
                out.setdefault(run, {}).update(_marks(packed))
    return out


def _marks(packed: PackedFolder) -> dict[str, str]:
    members = {name: packed.files[name] for name in WATCHED if name in packed.files}
    return {name: f"{member.size}.{member.mtime_ns}" for name, member in members.items()}


def _names(folder: str) -> list[str]:
    try:
        return os.listdir(folder)  # noqa: PTH208 - names are enough
    except (FileNotFoundError, NotADirectoryError):
        return []


def _mark(path: str) -> str:
    try:
        status = os.stat(path)  # noqa: PTH116 - a hundred thousand of these
    except OSError:
        return ""
    return f"{status.st_size}.{status.st_mtime_ns}"


def _stamps_of_objects(runs: ObjectPath) -> dict[str, str]:
    from pyarrow.fs import FileSelector, FileType

    marks: dict[str, dict[str, str]] = {}
    for info in runs.system.get_file_info(FileSelector(runs.key, allow_not_found=True, recursive=True)):
        run, _, name = info.path.rpartition("/")
        if info.type == FileType.File and name in WATCHED:
            marks.setdefault(run.rpartition("/")[2], {})[name] = f"{info.size}.{info.mtime_ns}"
    return {run: _short([of_run.get(n, "") for n in WATCHED]) for run, of_run in marks.items() if START in of_run}


def _short(marks: Iterable[str]) -> str:
    return hashlib.sha256("|".join(marks).encode()).hexdigest()[:16]
