"""The index: the rows that the audit needs of all runs, in few large files instead of many small ones.

``index/<part>/<table>.parquet`` holds some hundred runs each. It is derived from the runs' own files and from nothing else,
may be deleted at any time, and is brought up to date before every use: a part whose runs have changed is made again, new
runs make new parts. So it is never a second truth.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import re
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, NamedTuple
from weakref import finalize

import pyarrow as pa
import pyarrow.parquet as pq

from pipelines.archive import derived, files
from pipelines.archive.locks import alone
from pipelines.archive.store import ObjectPath, address_of, first_line, place_of
from pipelines.audit.run_files import read_runs, stamps_of
from pipelines.audit.run_rows import SCHEMAS, TABLES, rows_of_runs
from pipelines.parallel import map_partitions
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from pipelines.archive import Archive
    from pipelines.archive.store import Place
    from pipelines.parallel import Spread

FOLDER = "index"
RUNS_PER_PART = 500
MOST_SMALL = 24  # parts with less than half of that, before they are put together
SOURCES = ("run_files.py", "run_rows.py", "parameters.py", "station_effects.py")
VERSION = b"tumbleline.index"
NAME = re.compile("[0-9a-f]{16}")
SEAL = "seal.json"
READERS = 4


class Portion(NamedTuple):
    """Work for one process: a part of the index that is to be made of these runs.

    archive : its address; place : folder of the index where it is not the archive's own, else empty
    runs : with their stamps; version : of the code that makes the rows
    """

    archive: str
    place: str
    runs: tuple[tuple[str, str], ...]
    version: str


class _Fleeting:
    """A temporary folder that goes with whoever holds it."""

    def __init__(self) -> None:
        self.path = Path(mkdtemp(prefix="tumbleline-index-"))
        finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class _Reading:
    """Parts of a folder are not taken away as long as somebody holds this; the system ends it when a process dies."""

    def __init__(self, place: Path) -> None:
        handle = os.open(place, os.O_RDONLY)
        finalize(self, os.close, handle)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_SH)


@dataclass(frozen=True)
class AuditIndex:
    """The parts of an index that is up to date, and what had to be done for that.

    made, kept : numbers of runs that were read anew, and whose rows were there
    holder : keeps the parts there for as long as they may be read
    """

    parts: tuple[Place, ...]
    made: int
    kept: int
    holder: _Fleeting | _Reading | None = None

    def table(self, name: str, columns: Sequence[str] | None = None) -> pa.Table:
        """All rows of one of :data:`TABLES`; texts as dictionaries."""
        chosen = list(columns) if columns is not None else SCHEMAS[name].names
        texts = [field.name for field in SCHEMAS[name] if pa.types.is_string(field.type) and field.name in chosen]
        try:
            found = [
                pq.read_table(_opened(part / f"{name}.parquet"), columns=chosen, read_dictionary=texts)
                for part in self.parts
            ]
        except (OSError, pa.ArrowInvalid) as problem:
            where = self.parts[0].parent
            raise ArchiveUnusable(
                f"archive: index {where} cannot be read ({first_line(problem)}); remove {where}, it is made again by itself"
            ) from None
        if not found:
            return pa.table({n: pa.array([], SCHEMAS[name].field(n).type) for n in chosen})
        return pa.concat_tables(found).unify_dictionaries()

    def files(self, name: str) -> list[str]:
        """The files of one table, for those who read them themselves."""
        return [str(part / f"{name}.parquet") for part in self.parts]


def up_to_date(archive: Archive, spread: Spread | None = None, workers: int = 1) -> AuditIndex:
    """The index of an archive with every run as it is now.

    Where the archive cannot be written the index is made in a temporary folder, for this once.

    Parameters
    ----------
    spread, workers : where parts are made, see :func:`pipelines.parallel.map_partitions`
    """
    place = archive.root / FOLDER
    if not (archive.root / "runs").is_dir():  # an address with a slip of the pen is not made into a folder
        return AuditIndex((), 0, 0)
    try:
        with alone(place, wait=True):
            found = _refreshed(archive, place, spread, workers)
            return replace(found, holder=_Reading(place)) if isinstance(place, Path) else found
    except ArchiveUnusable:
        if isinstance(archive.root, Path) and os.access(archive.root, os.W_OK):
            raise
        holder = _Fleeting()
        return replace(_refreshed(archive, holder.path, spread, workers), holder=holder)


def _refreshed(archive: Archive, place: Place, spread: Spread | None, workers: int) -> AuditIndex:
    stamps, version = stamps_of(archive.root), version_of_rows()
    parts = _believed(part_folders(place), version)
    _remove(place, [part for part, runs in parts.items() if not runs])  # one that is made anew may have its name
    good = {part: runs for part, runs in parts.items() if runs and runs.items() <= stamps.items()}
    good = _without_doubles(good)
    small = [part for part, runs in good.items() if len(runs) < RUNS_PER_PART // 2]
    if len(small) > MOST_SMALL:
        good = {part: runs for part, runs in good.items() if part not in small}
    there = {run for runs in good.values() for run in runs}
    missing = sorted(stamps.keys() - there)
    chunks = [missing[k : k + RUNS_PER_PART] for k in range(0, len(missing), RUNS_PER_PART)]
    root = address_of(archive.root)
    own = "" if place == archive.root / FOLDER else str(place)
    portions = [Portion(root, own, tuple((r, stamps[r]) for r in chunk), version) for chunk in chunks]
    new = [place / name for name in map_partitions(make_part, portions, spread, workers=workers, name="audit index")]
    _remove(place, set(parts) - set(good) - set(new))
    return AuditIndex(tuple(sorted([*good, *new], key=str)), len(missing), len(there))


def make_part(portion: Portion) -> str:
    """Name of a part of the index, made of its runs' files and published."""
    root = place_of(portion.archive)
    runs, place = root / "runs", Path(portion.place) if portion.place else root / FOLDER
    found = rows_of_runs(read_runs(runs, portion.runs))
    # ``runs`` last: where it is, all are
    content = {f"{name}.parquet": _encoded(found[name], portion.version) for name in reversed(TABLES)}
    hashes = {file: files.hash_of(data) for file, data in content.items()}
    content = {SEAL: files.json_bytes(derived.seal(hashes)), **content}
    text = "\n".join([portion.version, *(f"{run} {stamp}" for run, stamp in portion.runs)])
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    files.publish_folder(place / name, content)
    return name


def _encoded(table: pa.Table, version: str) -> bytes:
    sink = pa.BufferOutputStream()
    marked = table.replace_schema_metadata({VERSION: version.encode()})
    pq.write_table(marked, sink, compression="zstd", compression_level=1)
    return sink.getvalue().to_pybytes()


def version_of_rows() -> str:
    """Hash of the code that makes the rows: an index made by other code is made again."""
    total = hashlib.sha256()
    for name in SOURCES:
        total.update((Path(__file__).parent / name).read_bytes())
    return total.hexdigest()[:16]


def _believed(folders: Sequence[Place], version: str) -> dict[Place, dict[str, str]]:
    """Runs of parts with their stamps; of a part that is not as it was made, none, and it is said that it was edited."""
    with ThreadPoolExecutor(READERS) as pool:
        states = dict(zip(folders, pool.map(standing_of, folders), strict=True))
    for part, state in states.items():
        if state == derived.EDITED:
            derived.tell_edited(part)
    return {part: runs_of(part, version) if state == derived.SOUND else {} for part, state in states.items()}


def standing_of(part: Place) -> str:
    """How the seal of a part stands, see :func:`pipelines.archive.derived.standing`; a part of an older version has none."""
    names = [f"{name}.parquet" for name in TABLES]
    if not all((part / name).is_file() for name in (*names, SEAL)):
        return derived.OTHERS
    try:
        found = json.loads((part / SEAL).read_bytes())
        hashes = {name: files.sha256(part / name) for name in names}
    except (OSError, ValueError, RecursionError):
        return derived.EDITED
    return derived.standing(found, hashes)


def part_folders(place: Place) -> list[Place]:
    """Folders of an index that are parts by their name."""
    if not place.is_dir():
        return []
    return sorted((part for part in place.iterdir() if NAME.fullmatch(part.name)), key=str)


def runs_of(part: Place, version: str) -> dict[str, str]:
    """Runs of a part with their stamps; empty where it is not of this version, lacks a table or cannot be read."""
    if not all((part / f"{name}.parquet").is_file() for name in TABLES):
        return {}
    try:
        table = pq.read_table(_opened(part / "runs.parquet"), columns=["run", "stamp"])
    except (OSError, pa.ArrowInvalid, KeyError):
        return {}
    if (table.schema.metadata or {}).get(VERSION, b"").decode() != version:
        return {}
    return dict(zip(table.column("run").to_pylist(), table.column("stamp").to_pylist(), strict=True))


def _without_doubles(parts: Mapping[Place, dict[str, str]]) -> dict[Place, dict[str, str]]:
    """The parts, less those that hold a run that another holds already."""
    seen: set[str] = set()
    kept: dict[Place, dict[str, str]] = {}
    for part, runs in sorted(parts.items(), key=lambda item: (-len(item[1]), str(item[0]))):
        if not seen & runs.keys():
            seen |= runs.keys()
            kept[part] = runs
    return kept


def _opened(file: Place) -> pa.BufferReader | str:
    return pa.BufferReader(file.read_bytes()) if isinstance(file, ObjectPath) else str(file)


def _remove(place: Place, parts: Collection[Place]) -> None:
    """Take parts away that are of no use any more, unless somebody may still be reading them: then the next one does."""
    if isinstance(place, ObjectPath):
        for part in parts:
            (place / part.name).remove_all()
        return
    with files.writers_of(place, fcntl.LOCK_EX | fcntl.LOCK_NB) if parts else nullcontext(enter_result=False) as mine:
        for part in parts if mine else ():
            shutil.rmtree(place / part.name, ignore_errors=True)
