"""The index: the rows of all runs that the audit needs, in few large files instead of many small ones.

Each ``index/<part>/<table>.parquet`` has some hundred runs. The index is made only from the files of the runs,
may be deleted at any time, and is updated before every use: a part whose runs have changed is made again, new
runs make new parts.
"""

import hashlib
import json
import os
import re
import shutil
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple
from weakref import finalize

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pipelines.archive import Archive, derived, files
from pipelines.archive.locks import alone
from pipelines.archive.store import ObjectPath, Place, address_of, first_line
from pipelines.audit.run_files import in_order_of_disk, read_runs, stamps_of
from pipelines.audit.run_rows import SCHEMAS, TABLES, rows_of_runs
from pipelines.integrity.findings import CHANGED, VerifiedPart
from pipelines.parallel import Distributor, map_partitions
from schemas import host
from schemas.errors import ArchiveUnusable

FOLDER = "index"
RUNS_PER_PART = 500
MOST_SMALL = 24  # parts with less than half of that, before they are merged
SOURCES = ("run_files.py", "run_rows.py", "parameters.py", "station_effects.py")
VERSION = b"tumbleline.index"
NAME = re.compile("[0-9a-f]{16}")
SEAL = "seal.json"
REMEDY = "remove it, it is made again from the runs"
READERS = 4


class Portion(NamedTuple):
    """Work for one process: a part of the index for these runs.

    archive : its address; folder : of an index outside the archive; empty: in the archive
    runs : with their stamps; version : of the code that makes the rows
    """

    archive: str
    folder: str
    runs: tuple[tuple[str, str], ...]
    version: str


class _Fleeting:
    """A temporary folder that is removed with its holder."""

    def __init__(self) -> None:
        self.path = Path(mkdtemp(prefix="tumbleline-index-"))
        finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class _Reading:
    """A shared lock: parts of the folder are not removed while a process holds it; it is released when the process dies."""

    def __init__(self, folder: Path) -> None:
        with suppress(OSError):  # a file system without locks, a system that opens no folders
            handle = os.open(folder, os.O_RDONLY)
            finalize(self, os.close, handle)
            host.lock(handle, host.SHARED)


@dataclass(frozen=True)
class AuditIndex:
    """The parts of an up-to-date index, and the work for the update.

    made, kept : numbers of runs that were read, and of runs with existing rows
    holder : keeps the parts while they may be read
    """

    parts: tuple[Place, ...]
    made: int
    kept: int
    holder: _Fleeting | _Reading | None = None

    def table(self, name: str, columns: Sequence[str] | None = None) -> pa.Table:
        """All rows of one of :data:`TABLES`; texts are dictionary-encoded."""
        chosen = list(columns) if columns is not None else SCHEMAS[name].names
        texts = [field.name for field in SCHEMAS[name] if pa.types.is_string(field.type) and field.name in chosen]
        try:
            tables = [
                pq.read_table(_opened(part / f"{name}.parquet"), columns=chosen, read_dictionary=texts)
                for part in self.parts
            ]
        except (OSError, pa.ArrowInvalid) as problem:
            where = self.parts[0].parent
            raise ArchiveUnusable(
                f"archive: index {where} cannot be read ({first_line(problem)}); remove {where}, it is made again automatically"
            ) from None
        if not tables:
            return pa.table({n: pa.array([], SCHEMAS[name].field(n).type) for n in chosen})
        return pa.concat_tables(tables).unify_dictionaries()

    def files(self, name: str) -> list[str]:
        """The files of one table, for direct reading."""
        return [str(part / f"{name}.parquet") for part in self.parts]


def up_to_date(archive: Archive, distribute: Distributor | None = None, workers: int = 1) -> AuditIndex:
    """The index of an archive with the present state of every run.

    Where the archive cannot be written the index is made in a temporary folder.

    Parameters
    ----------
    distribute, workers : where parts are made, see :func:`pipelines.parallel.map_partitions`
    """
    folder = archive.root / FOLDER
    if not (archive.root / "runs").is_dir():  # a mistyped address must not become a folder
        return AuditIndex((), 0, 0)
    try:
        with alone(folder, wait=True):
            index = _refreshed(archive, folder, distribute, workers)
            return replace(index, holder=_Reading(folder)) if isinstance(folder, Path) else index
    except ArchiveUnusable:
        if isinstance(archive.root, Path) and os.access(archive.root, os.W_OK):
            raise
        holder = _Fleeting()
        return replace(_refreshed(archive, holder.path, distribute, workers), holder=holder)


def _refreshed(archive: Archive, folder: Place, distribute: Distributor | None, workers: int) -> AuditIndex:
    stamps, version = stamps_of(archive.root), version_of_rows()
    parts = _believed(part_folders(folder), version)
    remove_parts(folder, [part for part, runs in parts.items() if not runs])  # a new part may have its name
    good = _without_doubles({part: runs for part, runs in parts.items() if runs and runs.items() <= stamps.items()})
    small = [part for part, runs in good.items() if len(runs) < RUNS_PER_PART // 2]
    if len(small) > MOST_SMALL:
        good = {part: runs for part, runs in good.items() if part not in small}
    indexed = {run for runs in good.values() for run in runs}
    missing = in_order_of_disk(archive.root, list(stamps.keys() - indexed))
    chunks = [missing[k : k + RUNS_PER_PART] for k in range(0, len(missing), RUNS_PER_PART)]
    root = address_of(archive.root)
    elsewhere = "" if folder == archive.root / FOLDER else str(folder)
    portions = [Portion(root, elsewhere, tuple((r, stamps[r]) for r in chunk), version) for chunk in chunks]
    names = map_partitions(make_part, portions, distribute, workers=workers, name="audit index")
    new = [folder / name for name in names]
    remove_parts(folder, set(parts) - set(good) - set(new))
    return AuditIndex(tuple(sorted([*good, *new], key=str)), len(missing), len(indexed))


def make_part(portion: Portion) -> str:
    """Make and publish a part of the index from the files of its runs; return its name."""
    root = Archive(portion.archive).root
    runs, folder = root / "runs", Path(portion.folder) if portion.folder else root / FOLDER
    tables = rows_of_runs(read_runs(runs, portion.runs))
    # ``runs`` last: it shows that all others exist
    content = {f"{name}.parquet": _encoded(tables[name], portion.version) for name in reversed(TABLES)}
    hashes = {file: files.hash_of(data) for file, data in content.items()}
    content = {SEAL: files.json_bytes(derived.seal(hashes)), **content}
    text = "\n".join([portion.version, *(f"{run} {stamp}" for run, stamp in portion.runs)])
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    files.publish_folder(folder / name, content)
    return name


def _encoded(table: pa.Table, version: str) -> bytes:
    sink = pa.BufferOutputStream()
    marked = table.replace_schema_metadata({VERSION: version.encode()})
    pq.write_table(marked, sink, compression="zstd", compression_level=1)
    return sink.getvalue().to_pybytes()


def version_of_rows() -> str:
    """Hash of the code that makes the rows; an index of other code is made again."""
    total = hashlib.sha256()
    for name in SOURCES:
        total.update((Path(__file__).parent / name).read_bytes())
    return total.hexdigest()[:16]


def _believed(folders: Sequence[Place], version: str) -> dict[Place, dict[str, str]]:
    """Runs of parts with their stamps; none of an edited part, with a warning."""
    with ThreadPoolExecutor(READERS) as pool:
        states = dict(zip(folders, pool.map(standing_of, folders), strict=True))
    for part, state in states.items():
        if state == derived.EDITED:
            derived.warn_of_edits(part)
    return {part: runs_of(part, version) if state == derived.SOUND else {} for part, state in states.items()}


def standing_of(part: Place) -> str:
    """State of the seal of a part, see :func:`pipelines.archive.derived.standing`; a part of an older version has none."""
    names = [f"{name}.parquet" for name in TABLES]
    if not all((part / name).is_file() for name in (*names, SEAL)):
        return derived.OTHERS
    try:
        seal = json.loads((part / SEAL).read_bytes())
        hashes = {name: files.sha256(part / name) for name in names}
    except (OSError, ValueError, RecursionError):
        return derived.EDITED
    return derived.standing(seal, hashes)


def part_folders(folder: Place) -> list[Place]:
    """Folders of an index with the name of a part."""
    if not folder.is_dir():
        return []
    return sorted((part for part in folder.iterdir() if NAME.fullmatch(part.name)), key=str)


def runs_of(part: Place, version: str) -> dict[str, str]:
    """Runs of a part with their stamps; empty where it has another version, lacks a table or cannot be read."""
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
    """The parts without those with a run that another part already has."""
    seen: set[str] = set()
    distinct: dict[Place, dict[str, str]] = {}
    for part, runs in sorted(parts.items(), key=lambda item: (-len(item[1]), str(item[0]))):
        if not seen & runs.keys():
            seen |= runs.keys()
            distinct[part] = runs
    return distinct


def _opened(file: Place) -> pa.BufferReader | str:
    return pa.BufferReader(file.read_bytes()) if isinstance(file, ObjectPath) else str(file)


def remove_parts(folder: Place, parts: Collection[Place]) -> None:
    """Remove obsolete parts, unless another process may still read them; then a later update removes them."""
    if isinstance(folder, ObjectPath):
        for part in parts:
            (folder / part.name).remove_all()
        return
    with files.writers_of(folder, host.EXCLUSIVE | host.AT_ONCE) if parts else nullcontext(enter_result=False) as mine:
        for part in parts if mine else ():
            shutil.rmtree(folder / part.name, ignore_errors=True)


def check_index(archive: Archive, checked: VerifiedPart) -> None:
    """The findings about the index of an archive.

    Parts of another version, which are never used, and runs that changed since are not checked.
    """
    stamps, version = stamps_of(archive.root), version_of_rows()
    for part in part_folders(archive.root / FOLDER):
        runs = runs_of(part, version)
        if standing_of(part) == derived.EDITED:
            checked.wrong(CHANGED, part, f"was edited since it was made: {REMEDY}")
        elif runs:
            unchanged = [(run, stamp) for run, stamp in runs.items() if stamps.get(run) == stamp]
            _check_rows(archive, part, unchanged, checked)


def _check_rows(archive: Archive, part: Place, runs: list[tuple[str, str]], checked: VerifiedPart) -> None:
    expected = rows_of_runs(read_runs(archive.root / "runs", runs))
    chosen = [run for run, _ in runs]
    for name in TABLES:
        path = part / f"{name}.parquet"
        table = pq.read_table(_opened(path))
        actual = table.filter(pc.field("run").isin(pa.array(chosen, pa.string())))
        if not _same(actual, expected[name], SCHEMAS[name]):
            checked.wrong(CHANGED, path, f"has other rows than the runs that it was made from: {REMEDY}")


def _same(actual: pa.Table, expected: pa.Table, schema: pa.Schema) -> bool:
    if actual.schema.names != schema.names or len(actual) != len(expected):
        return False
    return all(_same_column(actual[name], expected[name], schema.field(name).type) for name in schema.names)


def _same_column(actual: pa.ChunkedArray, expected: pa.ChunkedArray, kind: pa.DataType) -> bool:
    a, b = actual.cast(kind), expected.cast(kind)
    if not pa.types.is_floating(kind):
        return a.combine_chunks().equals(b.combine_chunks())
    return a.null_count == b.null_count and np.array_equal(a.to_numpy(), b.to_numpy(), equal_nan=True)
