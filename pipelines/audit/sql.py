"""SQL over the archive: DuckDB reads the Parquet files where they lie; nothing is loaded beforehand, nothing can be written."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import duckdb

from pipelines.audit.index import AuditIndex, up_to_date
from pipelines.audit.run_rows import SCHEMAS
from schemas.errors import WrongUse, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pyarrow as pa

    from pipelines.archive import Archive
    from pipelines.certificates.validity import Calibration

READING = {"SELECT", "EXPLAIN"}  # statements that change nothing; DESCRIBE, SHOW and WITH count as SELECT
FILES: tuple[str, ...] = (  # tables of the runs that are read where they lie
    "dwells", "residuals", "readings", "history", "verdicts", "covariance", "predictions", "wander", "verification",
    "verification_poses", "allan", "noise", "grades",
)  # fmt: skip
VIEWS = (*SCHEMAS, *FILES, "calibrations")
WORD = re.compile(r"[A-Za-z_]\w*")


@dataclass(frozen=True)
class Answer:
    """Names of the columns, and the rows of an answer."""

    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]


def ask(archive: Archive, sql: str, *, workers: int = 1, compact: bool = True) -> Answer:
    """The answer to a question in SQL.

    Views: those of the index (``runs``, ``units``, ``parameters``, ``station``, ``coefficients``, ``figures``), every other
    table of the runs by its name, with the column ``run`` in front, and ``calibrations``, the ledger. Only the files of the
    views that a question names are opened, and no file outside the archive.

    Parameters
    ----------
    compact : whether ``coefficients``, ``figures`` … are read from the index; else from the runs' own files, which is the same
    """
    statement = _one_reading_statement(sql)
    wanted = {word.lower() for word in WORD.findall(sql)} & set(VIEWS)
    with duckdb.connect(":memory:") as connection:
        # no extension is looked for in the network, and questions see the archive only
        connection.execute("SET autoinstall_known_extensions = false; SET autoload_known_extensions = false")
        index = up_to_date(archive, workers=workers) if wanted & SCHEMAS.keys() else None
        for name in sorted(wanted):
            _views(archive, index, compact=compact)[name](connection)
        _keep_inside(connection, archive, index)
        return _answered(connection, statement)


def _keep_inside(connection: duckdb.DuckDBPyConnection, archive: Archive, index: AuditIndex | None) -> None:
    """Let questions reach files of the archive and its index, and no others."""
    folders = [archive.root, *([part.parent for part in index.parts[:1]] if index else [])]
    allowed = [f"{folder.resolve()}/" for folder in folders if isinstance(folder, Path)]
    allowed += [f"{folder}/" for folder in folders if isinstance(folder, Path)]
    connection.execute(f"SET allowed_directories = {_list(allowed)}")
    connection.execute(
        "SET enable_progress_bar = false; SET enable_external_access = false; SET lock_configuration = true"
    )


def _answered(connection: duckdb.DuckDBPyConnection, statement: str) -> Answer:
    try:
        cursor = connection.execute(statement)
        return Answer(tuple(str(column[0]) for column in cursor.description or ()), cursor.fetchall())
    except duckdb.Error as problem:
        raise WrongUse(_explained(problem)) from None


def _one_reading_statement(sql: str) -> str:
    try:
        statements = duckdb.extract_statements(sql)
    except duckdb.Error as problem:
        raise WrongUse(_explained(problem)) from None
    kinds = [statement.type.name for statement in statements]
    if len(kinds) != 1 or kinds[0] not in READING:
        found = ", ".join(kinds).lower() or "no statement"
        raise WrongUse(
            f"query: found {found}, one SELECT is needed (the archive is only read); ask one question at a time"
        )
    return str(statements[0].query)


def _explained(problem: duckdb.Error) -> str:
    """What DuckDB says, in one sentence, with the views that are there where a table is unknown."""
    text = str(problem).splitlines()[0]
    unknown = re.search(r"Table with name (\S+) does not exist", text)
    if unknown:
        return f"query: no view is called '{unknown[1]}', one of the archive's is needed; {did_you_mean(unknown[1], VIEWS)}"
    return f"query: {text}; correct the question (views: {', '.join(VIEWS)})"


def _views(
    archive: Archive, index: AuditIndex | None, *, compact: bool
) -> Mapping[str, Callable[[duckdb.DuckDBPyConnection], None]]:
    """How every view is made."""
    out: dict[str, Callable[[duckdb.DuckDBPyConnection], None]] = {}
    for name in FILES:
        out[name] = _of_runs(archive, name)
    for name in SCHEMAS:
        plain = not compact and name in {"coefficients", "figures"}
        out[name] = _of_runs(archive, name) if plain else _of_index(index, name)
    out["calibrations"] = _of_ledger(archive)
    return out


def _of_index(index: AuditIndex | None, name: str) -> Callable[[duckdb.DuckDBPyConnection], None]:
    def make(connection: duckdb.DuckDBPyConnection) -> None:
        hidden = "EXCLUDE (stamp)" if name == "runs" else ""
        if index is None or not index.parts or not isinstance(index.parts[0], Path):
            content = index.table(name) if index is not None else SCHEMAS[name].empty_table()
            connection.register(f"{name}_rows", content)
            connection.execute(f"CREATE VIEW {name} AS SELECT * {hidden} FROM {name}_rows")  # noqa: S608 - our own names
            return
        connection.execute(f"CREATE VIEW {name} AS SELECT * {hidden} FROM read_parquet({_list(index.files(name))})")  # noqa: S608

    return make


def _of_runs(archive: Archive, name: str) -> Callable[[duckdb.DuckDBPyConnection], None]:
    def make(connection: duckdb.DuckDBPyConnection) -> None:
        runs = archive.root / "runs"
        if not isinstance(runs, Path):
            connection.register(f"{name}_rows", _gathered(runs.glob(f"*/{name}.parquet")))
            connection.execute(f"CREATE VIEW {name} AS SELECT * FROM {name}_rows")  # noqa: S608 - our own names
            return
        if next(runs.glob(f"*/{name}.parquet"), None) is None:
            raise WrongUse(f"query: no run in {archive.root} has a table '{name}'; there is nothing to ask")
        source = f"read_parquet({_text(f'{runs}/*/{name}.parquet')}, filename = true, union_by_name = true)"
        run = "split_part(filename, '/', -2) AS run"
        connection.execute(f"CREATE VIEW {name} AS SELECT {run}, * EXCLUDE (filename) FROM {source}")  # noqa: S608

    return make


def _gathered(files: Iterable[Any]) -> pa.Table:
    """Tables of an object store, which DuckDB does not reach without an extension: read here, with their run."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts: list[pa.Table] = []
    for place in files:
        table = pq.ParquetFile(pa.BufferReader(place.read_bytes())).read()
        parts.append(table.add_column(0, "run", pa.repeat(pa.scalar(place.parent.name), len(table))))
    return pa.concat_tables(parts, promote_options="default") if parts else pa.table({"run": pa.array([], pa.string())})


LEDGER: Mapping[str, Callable[[Calibration], str]] = {  # columns of the view, as a calibration's document names them
    "certificate": lambda one: one.certificate,
    "serial": lambda one: one.serial,
    "device": lambda one: one.event.device,
    "from": lambda one: one.start,
    "until": lambda one: one.until,
    "state": lambda one: one.state,
    "stated_until": lambda one: one.stated_until,
    "run": lambda one: one.run,
    "grade": lambda one: one.event.grade,
    "station": lambda one: one.event.station,
    "recipe": lambda one: one.event.recipe,
}


def _of_ledger(archive: Archive) -> Callable[[duckdb.DuckDBPyConnection], None]:
    def make(connection: duckdb.DuckDBPyConnection) -> None:
        import pyarrow as pa

        from pipelines.certificates.ledger import Ledger

        known = list(Ledger(archive).all())
        rows = {name: pa.array([of(one) for one in known], pa.string()) for name, of in LEDGER.items()}
        connection.register("calibrations_rows", pa.table(rows))
        connection.execute("CREATE VIEW calibrations AS SELECT * FROM calibrations_rows")

    return make


def _list(names: Iterable[str]) -> str:
    return f"[{', '.join(_text(name) for name in names)}]"


def _text(value: str) -> str:
    return "'" + value.replace("'", "''") + "'"
