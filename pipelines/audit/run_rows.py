"""The rows of runs in the tables of the index, made only from the files of the runs.

Files are read run by run, then all runs of a part are processed together, because a call costs more than the rows of a run.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from inertial.arrays import Index
from pipelines.archive.parquet import SCHEMA_MARK, TABLE_MARK
from pipelines.archive.store import first_line
from pipelines.audit.parameters import NAMES, parameters_of
from pipelines.audit.run_files import START, RunFiles
from pipelines.audit.station_effects import station_values
from schemas.errors import ArchiveUnusable
from schemas.units import AXES
from schemas.version import VERSION, upgraded

_TEXT, _NUMBER = pa.string(), pa.float64()
_FEW = pa.dictionary(pa.int32(), _TEXT)  # texts with few different values
READ: Mapping[str, pa.Schema] = {  # columns of the runs' tables
    "coefficients": pa.schema(
        [*((n, _FEW) for n in ("unit", "axis", "effect", "name")), ("value", _NUMBER), ("standard_error", _NUMBER),
         ("unit_text", _FEW)]
    ),
    "figures": pa.schema(
        [("unit", _FEW), ("figure", _FEW), ("value", _NUMBER), ("uncertainty", _NUMBER), ("limit", _NUMBER),
         ("unit_text", _FEW), ("outcome", _FEW), ("rule", _FEW)]
    ),
    "grades": pa.schema([("unit", _FEW), ("slot", pa.int64()), ("outcome", _FEW), ("grade", _FEW)]),
    "residuals": pa.schema(
        [("unit", _FEW), ("dwell", pa.int64()), ("axis", _FEW), ("pose", _FEW), ("force_g", _NUMBER),
         ("residual_ug", _NUMBER), ("unit_C", _NUMBER)]
    ),
}  # fmt: skip
TABLES = ("runs", "units", "parameters", "station", "coefficients", "figures")
RUN_FIELDS = ("run", "measured", "started", "recipe", "device", "station", "capture", "rerun_of", "problem", "stamp")


def _indexed(schema: pa.Schema) -> pa.Schema:
    """Columns of a run's table in the index: the run first, texts not encoded."""
    return pa.schema([("run", _TEXT), *((f.name, _TEXT if f.type == _FEW else f.type) for f in schema)])


SCHEMAS: Mapping[str, pa.Schema] = {
    "runs": pa.schema([(name, _TEXT) for name in RUN_FIELDS]),
    "units": _indexed(READ["grades"]),
    "parameters": pa.schema(
        [("run", _TEXT), ("unit", _TEXT), *((f"{n}{end}", _NUMBER) for n in NAMES for end in ("", "_error"))]
    ),
    "station": pa.schema([("run", _TEXT), ("effect", _TEXT), ("name", _TEXT), ("value", _NUMBER), ("error", _NUMBER)]),
    "coefficients": _indexed(READ["coefficients"]),
    "figures": _indexed(READ["figures"]),
}


class _Run(NamedTuple):
    """A readable run: its name, its ``run.json`` and its tables."""

    id: str
    about: Mapping[str, Any]
    tables: Mapping[str, pa.Table]


def rows_of_runs(run_files: Iterable[RunFiles]) -> dict[str, pa.Table]:
    """The rows of runs in every table of the index.

    An unreadable run (changed byte, foreign file, incomplete run) has no rows and its problem in ``runs``, so that one bad file
    does not hide the rest of an archive.
    """
    lines: list[tuple[str, ...]] = []
    runs: list[_Run] = []
    for files in run_files:
        about: dict[str, Any] = {}
        problem = files.trouble
        try:
            about = _about(files)
            runs.append(_Run(files.run, about, _tables(files)))
        except RecursionError:
            problem = problem or "a manifest is nested too deeply"
        except (OSError, ValueError, KeyError, TypeError, ArchiveUnusable) as trouble:  # ArrowInvalid is a ValueError
            problem = problem or first_line(trouble)
        lines.append(_line(files, about, problem))
    sources = {"units": "grades", "coefficients": "coefficients", "figures": "figures"}
    return {
        "runs": _from_rows(lines, SCHEMAS["runs"]),
        **{name: _together(runs, table, SCHEMAS[name]) for name, table in sources.items()},
        "parameters": _parameters([run for run in runs if len(run.tables.get("coefficients", ()))]),
        "station": _from_rows([row for run in runs for row in _station(run)], SCHEMAS["station"]),
    }


def _about(files: RunFiles) -> dict[str, Any]:
    if files.trouble:
        raise ValueError(files.trouble)
    content = json.loads(files.content[START])
    if not isinstance(content, dict):
        raise ValueError(f"{START} is no manifest")  # noqa: TRY004 - content of a file, not an argument
    return content


def _tables(files: RunFiles) -> dict[str, pa.Table]:
    """The existing tables of a run, checked against their manifests."""
    present = [name for name in READ if f"{name}.parquet" in files.content]
    return {name: _table(name, files.content) for name in present}


def _table(name: str, content: Mapping[str, bytes]) -> pa.Table:
    data, schema = content[f"{name}.parquet"], READ[name]
    if f"{name}.json" not in content:
        raise ValueError(f"{name}.parquet has no manifest")
    if hashlib.sha256(data).hexdigest() != json.loads(content[f"{name}.json"])["sha256"]:
        raise ValueError(f"{name}.parquet has changed since it was written")
    texts = [field.name for field in schema if field.type == _FEW]
    file = pq.ParquetFile(pa.BufferReader(data), read_dictionary=texts, pre_buffer=False)
    marks = file.schema_arrow.metadata or {}
    mark = marks.get(TABLE_MARK, b"").decode(errors="replace")
    if mark != name:
        raise ValueError(f"{name}.parquet has '{mark or 'a foreign table'}'")
    version = int(marks.get(SCHEMA_MARK, b"1"))
    if version == VERSION:
        table = file.read(columns=schema.names, use_threads=False)  # threads cost more than so few rows
    else:
        table = pa.Table.from_pandas(upgraded(name, file.read().to_pandas(), version, f"{name}.parquet"))
    return _in_schema(table, schema)


def _in_schema(table: pa.Table, expected: pa.Schema) -> pa.Table:
    """The columns of a schema, in its order and types; missing columns are empty."""
    actual_types = [table.schema.field(name).type if name in table.column_names else None for name in expected.names]
    if actual_types == expected.types:
        return table.select(expected.names)
    columns = [
        pa.nulls(len(table), field.type) if type_ is None else table.column(field.name).cast(field.type)
        for field, type_ in zip(expected, actual_types, strict=True)
    ]
    return pa.table(columns, schema=expected)


def _line(files: RunFiles, about: Mapping[str, Any], problem: str) -> tuple[str, ...]:
    recipe, lot, station = (about.get(key) or {} for key in ("recipe", "lot", "station"))
    row = {
        "run": files.run,
        "measured": about.get("measured", about.get("when", "")),
        "started": about.get("when", ""),
        "recipe": recipe.get("name", about.get("name", "")),
        "device": str(lot.get("device", "")).upper(),
        "station": station.get("name", ""),
        "capture": about.get("capture") or "",
        "rerun_of": about.get("rerun_of", ""),
        "problem": problem,
        "stamp": files.stamp,
    }
    return tuple(str(row[name]) for name in RUN_FIELDS)


def _together(runs: Sequence[_Run], name: str, schema: pa.Schema) -> pa.Table:
    """One table of all runs, with the run in front."""
    having = [run for run in runs if name in run.tables]
    if not having:
        return schema.empty_table()
    table = pa.concat_tables([run.tables[name] for run in having])
    names = np.repeat(np.array([run.id for run in having], dtype=object), [len(run.tables[name]) for run in having])
    return table.add_column(0, "run", pa.array(names, _TEXT)).cast(schema)


def _parameters(runs: Sequence[_Run]) -> pa.Table:
    """The parameters of every unit of every run, in the order of the coefficients of the runs."""
    schema = SCHEMAS["parameters"]
    if not runs:
        return schema.empty_table()
    table = pa.concat_tables([run.tables["coefficients"] for run in runs]).unify_dictionaries()
    counts = [len(run.tables["coefficients"]) for run in runs]
    zeros = [float((run.about.get("recipe") or {}).get("zero_output", 0.0)) for run in runs]
    units, unit = _coded(table, "unit")
    run = np.repeat(np.arange(len(runs)), counts)
    _, first, row = np.unique(run * len(units) + unit, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    columns = {name: _coded(table, name) for name in ("effect", "name", "axis")}
    numbers = [table.column(name).to_numpy() for name in ("value", "standard_error")]
    parameters = parameters_of(rank[row], columns, numbers[0], numbers[1], np.array(zeros)[run[first[order]]])
    names = [runs[k].id for k in run[first[order]]], [units[k] for k in unit[first[order]]]
    return pa.table({"run": names[0], "unit": names[1], **parameters}, schema=schema)


def _station(run: _Run) -> list[tuple[Any, ...]]:
    """The parameters of the station from the residuals, added to those in the run's own model."""
    recipe, residuals = run.about.get("recipe") or {}, run.tables.get("residuals")
    coefficients = run.tables.get("coefficients")
    if residuals is None or not len(residuals) or not coefficients or not recipe.get("poses"):
        return []
    frame = {name: residuals.column(name).to_numpy() for name in ("dwell", "force_g", "residual_ug", "unit_C")}
    axes, axis = _coded(residuals, "axis")
    poses, pose = _coded(residuals, "pose")
    frame |= {"unit": _coded(residuals, "unit")[1], "pose": pose}
    order = np.lexsort((np.array([AXES.index(text) for text in axes])[axis], frame["dwell"], frame["unit"]))
    frame = {name: values[order] for name, values in frame.items()}
    model = _coded(coefficients, "effect")[0]
    estimates = station_values({**frame, "pose": np.array(poses, dtype=object)[frame["pose"]]}, recipe, model)
    known = _of_the_model(coefficients)
    return [(run.id, v.effect, v.name, v.value + known.get((v.effect, v.name), 0.0), v.error) for v in estimates]


def _of_the_model(coefficients: pa.Table) -> dict[tuple[str, str], float]:
    """Coefficients of the station in the run's model, in millionths, by effect and name."""
    if "*" not in _coded(coefficients, "axis")[0]:
        return {}
    rows = coefficients.select(["axis", "effect", "name", "value"]).to_pylist()
    return {(row["effect"], row["name"]): 1e6 * row["value"] for row in rows if row["axis"] == "*"}


def _from_rows(rows: Sequence[tuple[Any, ...]], schema: pa.Schema) -> pa.Table:
    columns = list(zip(*rows, strict=True)) or [()] * len(schema)
    return pa.table([pa.array(c, f.type) for c, f in zip(columns, schema, strict=True)], schema=schema)


def _coded(table: pa.Table, name: str) -> tuple[list[str], Index]:
    """The different texts of a column, and the number of each row's."""
    column = table.column(name).combine_chunks()
    return column.dictionary.to_pylist(), column.indices.to_numpy().astype(np.int64)
