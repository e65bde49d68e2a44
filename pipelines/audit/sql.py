"""SQL over the archive: DuckDB reads the Parquet files in place; nothing is loaded before, nothing can be written."""

import mmap
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from pipelines.archive import Archive
from pipelines.archive.packed_path import member_of
from pipelines.archive.store import Place, first_line
from pipelines.audit.index import AuditIndex, up_to_date
from pipelines.audit.run_rows import SCHEMAS
from pipelines.audit.tables_in_memory import QueryResult, rows_of_index
from schemas.errors import ArchiveUnusable, WrongUse, did_you_mean
from schemas.library import library
from schemas.tables import TABLES

if TYPE_CHECKING:
    import duckdb

# no access to files, network, extensions or Python variables
SHUT_IN: dict[str, str | bool | int | float | list[str]] = {
    "enable_external_access": False,
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "python_enable_replacements": False,
}
BLANK = r"(?:\s|--[^\n]*\n|/\*(?:[^*]|\*(?!/))*\*/)*"
EXPLAINS = re.compile(  # the beginning of an EXPLAIN with its options, with comments between the words
    rf"{BLANK}EXPLAIN\b{BLANK}(?:ANALY[SZ]E\b|\((?=\s*(?:ANALY[SZ]E|FORMAT)\b)[\w\s',]*\))?", re.IGNORECASE
)
FILES = tuple(name for name in TABLES if name not in {*SCHEMAS, "samples"})  # tables of the runs that are read in place
VIEWS = (*SCHEMAS, *FILES, "calibrations")
WORD = re.compile(r"[A-Za-z_]\w*")


def ask(
    archive: Archive, sql: str, *, workers: int = 1, compact: bool = True, index: AuditIndex | None = None
) -> QueryResult:
    """The answer to an SQL query.

    Views: those of the index (``runs``, ``units``, ``parameters``, ``station``, ``coefficients``, ``figures``), every other
    table of the runs by its name, with the column ``run`` in front, and ``calibrations``, the ledger. Only the files of the
    views in the query are opened, for reading, by this program: the query engine has no access to files.

    Parameters
    ----------
    compact : whether ``coefficients``, ``figures`` … are read from the index; else from the files of the runs
    index : an index that the caller holds; None: the index is brought up to date first
    """
    statement = one_reading_statement(sql)
    views = {word.lower() for word in WORD.findall(sql)} & set(VIEWS)
    with _engine().connect(":memory:", config=SHUT_IN) as connection:
        if index is None and views & SCHEMAS.keys():
            index = up_to_date(archive, workers=workers)
        for name in sorted(views):
            connection.register(name, _views(archive, index, compact=compact)[name]())
        connection.execute("SET enable_progress_bar = false; SET lock_configuration = true")
        return _answered(connection, statement)


def _engine() -> Any:
    return library("duckdb", "sql", "query: SQL over the archive")


def _answered(connection: "duckdb.DuckDBPyConnection", statement: str) -> QueryResult:
    try:
        cursor = connection.execute(statement)
        return QueryResult(tuple(str(column[0]) for column in cursor.description or ()), cursor.fetchall())
    except _engine().Error as problem:
        raise WrongUse(_explained(problem)) from None


def one_reading_statement(sql: str) -> str:
    """The single SELECT of a query, or the EXPLAIN of one.

    A common table expression with a COPY is a SELECT for the parser, and other versions of DuckDB may have more such
    statements; protection against writing also comes from :data:`SHUT_IN`.

    Raises
    ------
    WrongUse
        The query is another statement, or more than one.
    """
    statement = _one_statement(sql)
    text = str(statement.query)
    if statement.type.name == "EXPLAIN":
        explained = EXPLAINS.match(text)
        inner = text[explained.end() :] if explained else ""
        if _one_statement(inner, "explain of ").type.name != "SELECT":
            _refuse(f"explain of {_kinds(inner)}")
    elif statement.type.name != "SELECT":
        _refuse(statement.type.name.lower())
    return text


def _one_statement(sql: str, before: str = "") -> "duckdb.Statement":
    try:
        statements = _engine().extract_statements(sql)
    except _engine().Error as problem:
        raise WrongUse(_explained(problem)) from None
    if len(statements) != 1:
        _refuse(before + (_kinds(sql) or "no statement"))
    return statements[0]


def _kinds(sql: str) -> str:
    return ", ".join(statement.type.name for statement in _engine().extract_statements(sql)).lower()


def _refuse(statement: str) -> NoReturn:
    raise WrongUse(
        f"query: found {statement}, one SELECT is needed (the archive is read only); give one query at a time"
    )


def _explained(problem: "duckdb.Error") -> str:
    """The message of DuckDB in one sentence, with the existing views where a table is unknown."""
    text = str(problem).splitlines()[0]
    unknown = re.search(r"Table with name (\S+) does not exist", text)
    if unknown:
        return f"query: no view is called '{unknown[1]}', one of the archive's is needed; {did_you_mean(unknown[1], VIEWS)}"
    if "Referenced column" in text:  # the index has the columns that an audit reads
        return f"query: {text}; correct the query, or give --no-index for every column of coefficients and figures"
    return f"query: {text}; correct the query (views: {', '.join(VIEWS)})"


def _views(archive: Archive, index: AuditIndex | None, *, compact: bool) -> Mapping[str, Callable[[], Any]]:
    """Functions that give the content of every view as Arrow data."""
    out: dict[str, Callable[[], Any]] = {name: partial(_of_runs, archive, name) for name in FILES}
    for name in SCHEMAS:
        plain = not compact and name in {"coefficients", "figures"}
        out[name] = partial(_of_runs, archive, name) if plain else partial(rows_of_index, index, name)
    out["calibrations"] = partial(_of_ledger, archive)
    return out


def _of_runs(archive: Archive, name: str) -> Any:
    runs = archive.root / "runs"
    if not isinstance(runs, Path):
        return gathered(runs.glob(f"*/{name}.parquet"))
    paths = sorted(runs.glob(f"*/{name}.parquet"))
    if not paths:
        raise WrongUse(f"query: no run in {archive.root} has a table '{name}', one is needed; query another view")
    return datasets_of_runs(paths)


LEDGER = (  # columns of the view: keys of a calibration's document
    *("certificate", "serial", "device", "from", "until", "state", "stated_until"),
    *("run", "grade", "station", "recipe"),
)


def _of_ledger(archive: Archive) -> pa.Table:
    from pipelines.certificates.ledger import Ledger

    known = [dict(event.document()) for event in Ledger(archive).all()]
    return pa.table({name: pa.array([entry[name] for entry in known], pa.string()) for name in LEDGER})


def datasets_of_runs(paths: Sequence[Path]) -> ds.Dataset:
    """Files ``…/<run>/<table>.parquet`` of a local archive, packed or not, as one table with the column ``run`` in front.

    A column that some runs do not have is null there.

    Raises
    ------
    ArchiveUnusable
        A file is no Parquet file, or a column has different types.
    """
    from pyarrow.fs import LocalFileSystem

    with ThreadPoolExecutor(8) as pool:
        file_schemas = list(pool.map(_schema, paths))
    try:
        columns = pa.unify_schemas(file_schemas, promote_options="permissive").remove_metadata()
    except (pa.ArrowInvalid, pa.ArrowTypeError) as problem:
        raise ArchiveUnusable(
            f"query: tables {paths[0].name} of the runs do not fit together ({first_line(problem)}); see 'tumbleline "
            "verify'"
        ) from None
    form, system = ds.ParquetFileFormat(), LocalFileSystem()
    parts: list[Any] = []
    for path in paths:
        run, source = ds.field("run") == path.parent.name, _source(path)
        filesystem = None if isinstance(source, pa.BufferReader) else system
        parts.append(form.make_fragment(source, filesystem, partition_expression=run))
    schema = pa.schema([("run", pa.string()), *(field for field in columns if field.name != "run")])
    return ds.FileSystemDataset(parts, schema=schema, format=form, filesystem=system)


def gathered(paths: Iterable[Place]) -> pa.Table:
    """Tables of an object store, read into memory, with the column ``run`` in front."""
    parts: list[pa.Table] = []
    for path in paths:
        table = pq.ParquetFile(pa.BufferReader(path.read_bytes())).read()
        parts.append(table.add_column(0, "run", pa.repeat(pa.scalar(path.parent.name), len(table))))
    return pa.concat_tables(parts, promote_options="default") if parts else pa.table({"run": pa.array([], pa.string())})


def _source(path: Path) -> pa.BufferReader | str:
    """The source of the bytes of a file: its path, or its part of a pack, which is read when it is needed."""
    member = member_of(path)
    if member is None:
        return str(path)
    try:
        pack = _mapped(str(member.pack))
    except FileNotFoundError:  # its pack was merged with others
        return pa.BufferReader(path.read_bytes())
    return pa.BufferReader(pa.py_buffer(memoryview(pack)[member.offset : member.offset + member.size]))


@lru_cache(maxsize=512)
def _mapped(pack: str) -> mmap.mmap:
    """A pack in the address space, which is never changed; the file may be closed."""
    with Path(pack).open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def _schema(path: Path) -> pa.Schema:
    try:
        return pq.read_schema(_source(path)).remove_metadata()
    except (OSError, pa.ArrowInvalid) as problem:
        raise ArchiveUnusable(
            f"query: {path} is not a complete Parquet file ({first_line(problem)}); restore it from a copy, see 'tumbleline "
            "verify'"
        ) from None
