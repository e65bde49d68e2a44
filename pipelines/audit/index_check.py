"""Check of the index of the audit: every row is made again from the runs and compared."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pipelines.archive import Archive, derived
from pipelines.archive.store import ObjectPath, Place
from pipelines.audit.index import FOLDER, part_folders, runs_of, standing_of, version_of_rows
from pipelines.audit.run_files import read_runs, stamps_of
from pipelines.audit.run_rows import SCHEMAS, TABLES, rows_of_runs
from pipelines.integrity.findings import CHANGED, VerifiedPart

REMEDY = "remove it, it is made again from the runs"


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
            _check_rows(
                archive, part, [(run, stamp) for run, stamp in runs.items() if stamps.get(run) == stamp], checked
            )


def _check_rows(archive: Archive, part: Place, runs: list[tuple[str, str]], checked: VerifiedPart) -> None:
    expected = rows_of_runs(read_runs(archive.root / "runs", runs))
    chosen = [run for run, _ in runs]
    for name in TABLES:
        place = part / f"{name}.parquet"
        table = pq.read_table(pa.BufferReader(place.read_bytes()) if isinstance(place, ObjectPath) else str(place))
        actual = table.filter(pc.field("run").isin(pa.array(chosen, pa.string())))
        if not _same(actual, expected[name], SCHEMAS[name]):
            checked.wrong(CHANGED, place, f"has other rows than the runs that it was made from: {REMEDY}")


def _same(actual: pa.Table, expected: pa.Table, schema: pa.Schema) -> bool:
    if actual.schema.names != schema.names or len(actual) != len(expected):
        return False
    return all(_same_column(actual[name], expected[name], schema.field(name).type) for name in schema.names)


def _same_column(actual: pa.ChunkedArray, expected: pa.ChunkedArray, kind: pa.DataType) -> bool:
    a, b = actual.cast(kind), expected.cast(kind)
    if not pa.types.is_floating(kind):
        return a.combine_chunks().equals(b.combine_chunks())
    return a.null_count == b.null_count and np.array_equal(a.to_numpy(), b.to_numpy(), equal_nan=True)
