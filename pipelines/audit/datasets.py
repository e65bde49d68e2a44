"""Tables of many runs as one read-only Arrow data set, read from their files when they are scanned.

A query engine with these data sets needs no access to files, so that it can be denied.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from pipelines.archive.packed_path import member_of
from pipelines.archive.store import Place, first_line
from schemas.errors import ArchiveUnusable

READERS = 8


def of_index(names: Sequence[str], schema: pa.Schema) -> ds.Dataset:
    """The files of one table of the index as one table.

    Parameters
    ----------
    schema : of every file.
    """
    from pyarrow.fs import LocalFileSystem

    form, system = ds.ParquetFileFormat(), LocalFileSystem()
    return ds.FileSystemDataset(
        [form.make_fragment(name, system) for name in names], schema=schema, format=form, filesystem=system
    )


def of_runs(places: Sequence[Path]) -> ds.Dataset:
    """Files ``…/<run>/<table>.parquet`` of a local archive, packed or not, as one table with the column ``run`` in front.

    A column that some runs do not have is null there.

    Raises
    ------
    ArchiveUnusable
        A file is no Parquet file, or a column has different types.
    """
    from pyarrow.fs import LocalFileSystem

    with ThreadPoolExecutor(READERS) as pool:
        file_schemas = list(pool.map(_schema, places))
    try:
        columns = pa.unify_schemas(file_schemas, promote_options="permissive").remove_metadata()
    except (pa.ArrowInvalid, pa.ArrowTypeError) as problem:
        raise ArchiveUnusable(
            f"query: tables {places[0].name} of the runs do not fit together ({first_line(problem)}); see 'tumbleline "
            "verify'"
        ) from None
    form, system = ds.ParquetFileFormat(), LocalFileSystem()
    parts: list[Any] = []
    for place in places:
        run, source = ds.field("run") == place.parent.name, _source(place)
        own = None if isinstance(source, pa.BufferReader) else system
        parts.append(form.make_fragment(source, own, partition_expression=run))
    schema = pa.schema([("run", pa.string()), *(field for field in columns if field.name != "run")])
    return ds.FileSystemDataset(parts, schema=schema, format=form, filesystem=system)


def gathered(places: Iterable[Place]) -> pa.Table:
    """Tables of an object store, read into memory, with the column ``run`` in front."""
    parts: list[pa.Table] = []
    for place in places:
        table = pq.ParquetFile(pa.BufferReader(place.read_bytes())).read()
        parts.append(table.add_column(0, "run", pa.repeat(pa.scalar(place.parent.name), len(table))))
    return pa.concat_tables(parts, promote_options="default") if parts else pa.table({"run": pa.array([], pa.string())})


def _source(place: Path) -> pa.BufferReader | str:
    """Where the bytes of a file are: its own path, or its part of a pack, which is read when it is needed."""
    member = member_of(place)
    if member is None:
        return str(place)
    try:
        whole = _mapped(str(member.pack))
    except FileNotFoundError:  # its pack was merged with others
        return pa.BufferReader(place.read_bytes())
    return pa.BufferReader(pa.py_buffer(memoryview(whole)[member.offset : member.offset + member.size]))


@lru_cache(maxsize=512)
def _mapped(pack: str) -> mmap.mmap:
    """A pack in the address space, which is never changed; the file may be closed."""
    with Path(pack).open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def _schema(place: Path) -> pa.Schema:
    try:
        return pq.read_schema(_source(place)).remove_metadata()
    except (OSError, pa.ArrowInvalid) as problem:
        raise ArchiveUnusable(
            f"query: {place} is not a complete Parquet file ({first_line(problem)}); restore it from a copy, see 'tumbleline "
            "verify'"
        ) from None
