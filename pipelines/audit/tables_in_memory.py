"""Some tables of an index in the memory of this process, for queries that open no file and need no further library."""

import sqlite3
import threading
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import finalize

import pyarrow as pa
import pyarrow.dataset as ds

from pipelines.audit.index import AuditIndex
from pipelines.audit.run_rows import SCHEMAS
from schemas.errors import WrongUse


@dataclass(frozen=True)
class QueryResult:
    """Column names and rows of an answer."""

    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]

    def documents(self) -> list[dict[str, Any]]:
        """The rows by column name, which must differ."""
        twice = next((name for name in self.columns if self.columns.count(name) > 1), None)
        if twice is not None:
            raise WrongUse(f"query: two columns are called '{twice}', names that differ are needed; rename one with AS")
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]


class TablesInMemory:
    """Tables for SQL queries in SQLite's dialect, read only. For many threads."""

    def __init__(self, tables: Mapping[str, pa.Table]) -> None:
        self._asking = threading.Lock()
        self._connection = sqlite3.connect(":memory:", check_same_thread=False)
        # lower() of SQLite leaves letters beyond ASCII
        self._connection.create_function("lower", 1, str.lower, deterministic=True)
        for name, table in tables.items():
            columns = ", ".join(f'"{column}"' for column in table.column_names)
            places = ", ".join("?" * table.num_columns)
            rows = zip(*(column.to_pylist() for column in table.columns), strict=True)
            self._connection.execute(f'CREATE TABLE "{name}" ({columns})')
            self._connection.executemany(f'INSERT INTO "{name}" VALUES ({places})', rows)  # noqa: S608 - names of SCHEMAS
        self._connection.commit()
        self._connection.execute("PRAGMA query_only = ON")
        finalize(self, self._connection.close)

    def ask(self, sql: str) -> QueryResult:
        """The answer to a query over these tables."""
        try:
            with self._asking:
                cursor = self._connection.execute(sql)
                return QueryResult(tuple(column[0] for column in cursor.description or ()), cursor.fetchall())
        except sqlite3.Error as problem:
            raise WrongUse(f"query: {problem}; correct the query") from None


def rows_of_index(index: AuditIndex | None, name: str) -> Any:
    """A table of the index as Arrow data: its files, to be read when they are scanned, or the table where they are elsewhere."""
    columns = [column for column in SCHEMAS[name].names if column != "stamp"]
    if index is None or not index.parts or not isinstance(index.parts[0], Path):
        return index.table(name, columns) if index is not None else SCHEMAS[name].empty_table().select(columns)
    from pyarrow.fs import LocalFileSystem

    schema = pa.schema([SCHEMAS[name].field(column) for column in columns])
    form, system = ds.ParquetFileFormat(), LocalFileSystem()
    parts = [form.make_fragment(file, system) for file in index.files(name)]
    return ds.FileSystemDataset(parts, schema=schema, format=form, filesystem=system)


def in_memory(index: AuditIndex, names: Collection[str]) -> TablesInMemory:
    """Whole tables of an index."""
    return TablesInMemory({name: _scanned(index, name) for name in names})


def unit_in_memory(index: AuditIndex, unit: str) -> TablesInMemory:
    """The coefficients of one unit in all its runs, and these runs."""
    coefficients = _scanned(index, "coefficients", ds.field("unit") == unit)
    runs = ds.field("run").isin(coefficients["run"].unique())
    return TablesInMemory({"coefficients": coefficients, "runs": _scanned(index, "runs", runs)})


def _scanned(index: AuditIndex, name: str, where: Any = None) -> pa.Table:
    rows = rows_of_index(index, name)
    return (ds.dataset(rows) if isinstance(rows, pa.Table) else rows).to_table(filter=where)
