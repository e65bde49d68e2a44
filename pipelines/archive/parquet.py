"""Tables of the archive as Parquet: equal tables give equal bytes on every host at any time; reading checks everything."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pipelines.archive.files import hash_of
from pipelines.archive.store import Place, first_line
from schemas.errors import ArchiveUnusable
from schemas.version import VERSION, upgraded

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

TABLE_MARK = b"tumbleline.table"
SCHEMA_MARK = b"tumbleline.schema"
_FOLDER = re.compile(r".*/(runs|captures)/[^/]+(?=/)")


def table_bytes(name: str, frame: pd.DataFrame, version: int) -> bytes:
    """A table as Parquet: zstd, no index, no library notes, the table's name and schema version in the metadata."""
    return encoded(columns_of(name, frame, version))


def columns_of(name: str, frame: pd.DataFrame, version: int) -> pa.Table:
    """The columns of a table with its name and schema version, as they are encoded."""
    import pyarrow as pa  # imports in 0.25 s, which commands without a table do not need

    columns = {str(column): pa.array(frame[column], from_pandas=True) for column in frame.columns}
    return pa.table(columns, metadata={TABLE_MARK: name.encode(), SCHEMA_MARK: str(version).encode()})


def encoded(table: pa.Table) -> bytes:
    """A table's bytes as Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", compression_level=3)
    return sink.getvalue().to_pybytes()


def decoded(data: bytes, columns: Sequence[str] = ()) -> pa.Table:
    """The table that a Parquet file's bytes hold, or named columns of it; all columns of a table of an older version."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(pa.BufferReader(data))
    selects = columns and (file.schema_arrow.metadata or {}).get(SCHEMA_MARK) == str(VERSION).encode()
    # one small file: a data set reader with threads would take longer than the reading itself
    return file.read(columns=list(columns) if selects else None, use_threads=False)


def _remedy(path: Place) -> str:
    """The remedy for a damaged table: results of a run can be computed again, those of a capture only be measured again."""
    restore = "restore it from a copy that 'tumbleline archive backup' made"
    found = _FOLDER.match(str(path))
    if found is None:
        return restore
    again = {"runs": "make the run again: its capture is kept", "captures": "measure again with 'tumbleline run'"}
    return f"{restore}, or remove {found[0]} and {again[found[1]]}"


def read_table(path: Place, name: str, expected: str | None = None, columns: Sequence[str] = ()) -> pd.DataFrame:
    """A table of the archive, checked to be complete, written by this archive and unchanged.

    expected : hash that the manifest gives; None where there is no manifest to compare with.
    columns : those that the caller reads; all where none is named. A table of an older version has all its columns.
    """
    import pyarrow as pa

    try:
        data = path.read_bytes()
    except (FileNotFoundError, IsADirectoryError):
        raise ArchiveUnusable(
            f"archive: {path} is not there, table '{name}' is needed; if the run was stopped, give its command again "
            "and it goes on"
        ) from None
    try:
        table = decoded(data, columns)
    except (pa.ArrowInvalid, OSError) as problem:
        raise ArchiveUnusable(
            f"archive: {path} ({len(data)} bytes) is not a whole Parquet file ({first_line(problem)}); {_remedy(path)}"
        ) from None
    marks = table.schema.metadata or {}
    mark = marks.get(TABLE_MARK, b"").decode(errors="replace")
    if mark != name:
        found = f"holds table '{mark}'" if mark else "was not written by this archive"
        raise ArchiveUnusable(
            f"archive: {path} {found}, table '{name}' is needed; import foreign files with 'tumbleline import'"
        )
    if expected is not None and hash_of(data) != expected:
        raise ArchiveUnusable(
            f"archive: {path} has changed since it was written (its hash is not its manifest's); {_remedy(path)}"
        )
    return upgraded(name, table.to_pandas(use_threads=False), int(marks.get(SCHEMA_MARK, b"1")), str(path))
