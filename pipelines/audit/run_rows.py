"""What the audit keeps of one run: its rows in the tables of the index, made from its files and from nothing else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pipelines.audit.parameters import NAMES, parameters_of
from pipelines.audit.station_effects import station_values

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipelines.archive.store import Place

KEPT: Mapping[str, list[str]] = {  # tables that are read, with their columns of few different texts
    "coefficients": ["unit", "axis", "effect", "name", "unit_text"],
    "figures": ["unit", "figure", "unit_text", "outcome", "rule"],
    "grades": ["unit", "outcome", "grade"],
    "residuals": ["unit", "axis", "pose"],
}
TABLES = ("runs", "units", "parameters", "station", "coefficients", "figures")

_TEXT, _NUMBER = pa.string(), pa.float64()
RUN_FIELDS = ("run", "measured", "started", "recipe", "device", "station", "capture", "rerun_of", "problem", "stamp")
SCHEMAS: Mapping[str, pa.Schema] = {
    "runs": pa.schema([(name, _TEXT) for name in RUN_FIELDS]),
    "units": pa.schema([("run", _TEXT), ("unit", _TEXT), ("slot", pa.int64()), ("outcome", _TEXT), ("grade", _TEXT)]),
    "parameters": pa.schema(
        [("run", _TEXT), ("unit", _TEXT), *((f"{n}{end}", _NUMBER) for n in NAMES for end in ("", "_error"))]
    ),
    "station": pa.schema(
        [("run", _TEXT), ("effect", _TEXT), ("name", _TEXT), ("value", _NUMBER), ("error", _NUMBER)]
    ),
    "coefficients": pa.schema(
        [("run", _TEXT), *((n, _TEXT) for n in ("unit", "axis", "effect", "name")), ("value", _NUMBER),
         ("standard_error", _NUMBER), ("unit_text", _TEXT)]
    ),
    "figures": pa.schema(
        [("run", _TEXT), ("unit", _TEXT), ("figure", _TEXT), ("value", _NUMBER), ("uncertainty", _NUMBER),
         ("limit", _NUMBER), ("unit_text", _TEXT), ("outcome", _TEXT), ("rule", _TEXT)]
    ),
}  # fmt: skip


def rows_of_run(path: Place, stamp: str) -> dict[str, pa.Table]:
    """The rows of one run in the tables of the index that it has any in.

    What cannot be read (a changed byte, a foreign file, a run cut off) makes a run without rows, with the problem in ``runs``:
    one bad file must not hide the rest of an archive.

    Parameters
    ----------
    path : the run's folder; stamp : what its files looked like, from which a change is seen
    """
    about: dict[str, Any] = {}
    try:
        about = json.loads((path / "run.json").read_bytes())
        tables, problem = {name: _table(path, name) for name in KEPT}, ""
    except (OSError, ValueError, KeyError) as trouble:  # ArrowInvalid and JSONDecodeError are ValueErrors
        tables, problem = dict.fromkeys(KEPT), str(trouble).splitlines()[0] or type(trouble).__name__
    out = {"runs": _run_row(path.name, about, stamp, problem)}
    for name in ("coefficients", "figures"):
        if tables[name] is not None:
            out[name] = _with_run(path.name, tables[name], SCHEMAS[name])
    if tables["grades"] is not None:
        out["units"] = _with_run(path.name, tables["grades"], SCHEMAS["units"])
    if tables["coefficients"] is not None and len(tables["coefficients"]):
        out |= _derived(path.name, about, tables)
    return out


def _table(path: Place, name: str) -> pa.Table | None:
    """A table as it was written; None where the run has none of this name."""
    manifest = path / f"{name}.json"
    try:
        data = (path / f"{name}.parquet").read_bytes()
    except FileNotFoundError:
        return None
    if hashlib.sha256(data).hexdigest() != json.loads(manifest.read_bytes())["sha256"]:
        message = f"{name}.parquet has changed since it was written"
        raise ValueError(message)
    file = pq.ParquetFile(pa.BufferReader(data), read_dictionary=KEPT[name], pre_buffer=False)
    table = file.read(use_threads=False)  # threads cost more than so few rows
    mark = (table.schema.metadata or {}).get(b"tumbleline.table", b"").decode()
    if mark != name:
        message = f"{name}.parquet holds '{mark or 'a foreign table'}'"
        raise ValueError(message)
    return table


def _with_run(run: str, table: pa.Table, schema: pa.Schema) -> pa.Table:
    def column(field: pa.Field) -> pa.ChunkedArray | pa.Array:
        there = field.name in table.column_names
        return table.column(field.name).cast(field.type) if there else pa.nulls(len(table), field.type)

    return pa.table([pa.repeat(pa.scalar(run), len(table)), *map(column, list(schema)[1:])], schema=schema)


def _run_row(run: str, about: Mapping[str, Any], stamp: str, problem: str) -> pa.Table:
    recipe, lot, station = (about.get(key) or {} for key in ("recipe", "lot", "station"))
    row = {
        "run": run,
        "measured": about.get("measured", about.get("when", "")),
        "started": about.get("when", ""),
        "recipe": recipe.get("name", about.get("name", "")),
        "device": str(lot.get("device", "")).upper(),
        "station": station.get("name", ""),
        "capture": about.get("capture") or "",
        "rerun_of": about.get("rerun_of", ""),
        "problem": problem,
        "stamp": stamp,
    }
    return pa.table({name: [str(row[name])] for name in RUN_FIELDS}, schema=SCHEMAS["runs"])


def _derived(run: str, about: Mapping[str, Any], tables: Mapping[str, pa.Table | None]) -> dict[str, pa.Table]:
    recipe = about.get("recipe") or {}
    coefficients = _columns(tables["coefficients"], ("unit", "axis", "effect", "name", "value", "standard_error"))
    units, values = parameters_of(coefficients, float(recipe.get("zero_output", 0.0)))
    wide = {"run": [run] * len(units), "unit": units, **values}
    out = {"parameters": pa.table(wide, schema=SCHEMAS["parameters"])}
    if tables["residuals"] is not None and recipe.get("poses"):
        out["station"] = _station(run, recipe, coefficients, tables["residuals"])
    return out


def _station(
    run: str, recipe: Mapping[str, Any], coefficients: Mapping[str, NDArray[Any]], residuals: pa.Table
) -> pa.Table:
    """The station's values that the residuals tell, on top of those that the run's own model has taken up."""
    frame = _columns(residuals, ("dwell", "pose", "force_g", "residual_ug", "unit_C"))
    frame["unit"], axis = _codes(residuals, "unit"), _codes(residuals, "axis", ("x", "y", "z"))
    order = np.lexsort((axis, frame["dwell"], frame["unit"]))
    model = list(dict.fromkeys(coefficients["effect"].tolist()))
    found = station_values({name: values[order] for name, values in frame.items()}, recipe, model)
    shared = coefficients["axis"] == "*"
    in_model = {(e, n): 1e6 * float(v) for e, n, v in zip(*(coefficients[c][shared] for c in ("effect", "name", "value")),
                                                           strict=True)}  # fmt: skip
    rows = [(run, v.effect, v.name, v.value + in_model.get((v.effect, v.name), 0.0), v.error) for v in found]
    return _from_rows(rows, SCHEMAS["station"])


def _from_rows(rows: Sequence[tuple[Any, ...]], schema: pa.Schema) -> pa.Table:
    columns = list(zip(*rows, strict=True)) or [()] * len(schema)
    return pa.table([pa.array(c, f.type) for c, f in zip(columns, schema, strict=True)], schema=schema)


def _codes(table: pa.Table, name: str, known: Sequence[str] = ()) -> NDArray[Any]:
    """A column of texts as numbers: by their place in ``known``, or any where none are given."""
    column = table.column(name).combine_chunks()
    texts, numbers = column.dictionary.to_pylist(), column.indices.to_numpy()
    return np.array([known.index(text) for text in texts])[numbers] if known else numbers


def _columns(table: pa.Table | None, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    if table is None:
        return {}
    return {name: table.column(name).to_numpy() for name in names}
