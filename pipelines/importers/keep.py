"""Imports in the archive: each is a run, named by the hash of its inputs, whose tables name source, parameters and code."""

import hashlib
from collections.abc import Mapping as Parameters
from typing import Any

import numpy as np
import pandas as pd

from inertial.quantities import OUTPUT_COLUMNS, SLOW_COLUMNS, SPREAD_COLUMNS
from pipelines.archive import Archive, Run, code_hash, stage_key
from pipelines.archive.buffered_run import BufferedRun
from pipelines.archive.provenance import provenance
from pipelines.archive.run import START
from pipelines.importers.files import SourceFile
from pipelines.importers.judged import FitAnswer
from pipelines.importers.mapping import OUTPUT_UNITS, Mapping
from pipelines.importers.record import Imported
from pipelines.importers.record_dwells import turned
from pipelines.importers.unit_check import DOUBT, size_of, unit_of
from pipelines.tables.dwell_table import output_axes
from schemas.errors import WrongUse
from schemas.foreign import shown
from schemas.import_references import ImportReferences


def keep_tables(
    kind: str,
    source_sha256: str,
    parameters: Parameters[str, Any],
    about: dict[str, Any],
    tables: Parameters[str, pd.DataFrame],
    archive: str | None,
) -> Run:
    """The run that holds the tables of an import.

    Parameters
    ----------
    kind : of the import, a name of :data:`pipelines.archive.code.CODE`
    parameters : everything that the command states and that decides the tables: another statement is another run
    """
    inputs, code = {"source": source_sha256}, code_hash(kind)
    key = stage_key("import", inputs, parameters, code)
    store = Archive(archive)
    store.prepare()
    run = BufferedRun(store, store.run_name("import", {"key": key}))
    if not (run.path / START).is_file():
        run.begin({**provenance(), **about})
    if not run.has(tuple(tables), key):
        run.save("import", key, tables, {"inputs": inputs, "parameters": parameters, "code": code})
    run.flush(last=START)  # together: a full disk leaves no run without its tables
    run.seal()
    return Run(store, run.id)


def lot_of_import(units: list[str], dwells: pd.DataFrame | None = None, device: str = "") -> dict[str, Any]:
    """The lot of an import: its units with their slots where the dwells tell them, and the device where it is stated."""
    slots: dict[str, int] = {}
    if dwells is not None and "slot" in dwells.columns:
        first = dwells.drop_duplicates("unit")
        slots = dict(zip(first["unit"].astype(str), first["slot"].astype(int), strict=True))
    return {"device": device or "imported", "units": [{"serial": unit, "slot": slots.get(unit, 0)} for unit in units]}


def keep_table_of_dwells(
    dwells: pd.DataFrame,
    history: pd.DataFrame | None,
    name: str,
    archive: str | None,
    source: SourceFile | None = None,
    device: str = "",
) -> Run:
    """The run that holds a table of dwells in the exchange format, complete for a fit (:func:`complete_table`)."""
    tables = {"dwells": dwells} if history is None else {"dwells": dwells, "history": history}
    digest = hashlib.sha256()
    for table in tables.values():
        digest.update(table.to_csv(index=False).encode())
    serials = list(dict.fromkeys(dwells["unit"].astype(str)))
    about: dict[str, Any] = {
        "name": f"dwells of {', '.join(serials[:3])}{', …' * (len(serials) > 3)}",
        "lot": lot_of_import(serials, dwells, device),
        "remarks": [],
    }
    about |= {} if source is None else {"source": source.as_dict()}
    parameters = {"dwells": name} | ({"device": device} if device else {})
    return keep_tables("import", digest.hexdigest(), parameters, about, tables, archive)


def complete_table(dwells: pd.DataFrame, unit: str = "") -> tuple[pd.DataFrame, tuple[str, ...]]:
    """A table of dwells with the kind, pose, output unit and force that it does not have, and what was assumed, as sentences.

    Parameters
    ----------
    unit : of the outputs in the table; empty: that of its column ``out_unit``, else what their size at rest says beyond doubt
    """
    if unit and unit not in OUTPUT_UNITS:
        raise WrongUse(f"output in '{shown(unit)}': one of {', '.join(OUTPUT_UNITS)} is needed")
    if unit and "out_unit" in dwells.columns:
        raise WrongUse(f"output in {unit} was given, the table has a column out_unit; leave out one of them")
    dwells, told = dwells.copy(), []
    outputs = [OUTPUT_COLUMNS[axis] for axis in output_axes(dwells.columns)]
    if "out_unit" not in dwells.columns and not unit and len(outputs) == len(OUTPUT_COLUMNS):
        values = dwells[outputs].to_numpy(dtype=np.float64)
        likely, reason = unit_of(values, size_of(values), means=True)
        unit = "" if reason.endswith(DOUBT) else likely
        told += [f"outputs in {unit}: {reason}"] if unit else []
    if unit:
        dwells["out_unit"], factor = OUTPUT_UNITS[unit]
        spreads = [names[axis] for axis in output_axes(dwells.columns) for names in (SPREAD_COLUMNS, SLOW_COLUMNS)]
        for column in (*outputs, *(name for name in spreads if name in dwells.columns)):
            dwells[column] *= factor
    for column, value in (("kind", "dwell"), ("pose", "dwell " + dwells["dwell"].astype(str)), ("slot", 0)):
        if column not in dwells.columns:
            dwells[column] = value
    return turned(dwells), tuple(told)


def keep(
    data: Imported,
    source: SourceFile,
    how: Mapping,
    judged: FitAnswer | None,
    archive: str | None,
    references: ImportReferences | None = None,
) -> Run:
    """The run that holds samples, dwells and coefficients of an import.

    Parameters
    ----------
    references : what is stated of the references of the measurement; None: noise only
    """
    parameters = {"mapping": how.model_dump(mode="json"), "fit": None if judged is None else judged.method}
    if references is not None:
        parameters["references"] = references.model_dump(mode="json")
    about: dict[str, Any] = {
        "name": f"import of {', '.join(data.units[:3])}{', …' * (len(data.units) > 3)}",
        "source": source.as_dict(), "mapping": parameters["mapping"], "remarks": list(data.remarks),
        "lot": lot_of_import(data.units, data.dwells, how.device),
    }  # fmt: skip
    if judged is not None and judged.effects:
        model = {"effects": list(judged.effects), "formulas": [], "model_name": "", "model_version": 0}
        about["recipe"] = {"name": "import", **model}
    if judged is not None and "across" in judged.document:
        about["plane_across"] = judged.document["across"]
    if how.measured is not None:
        about["measured"] = how.measured.isoformat()
    if references is not None:
        about["station"] = references.station()
        about["recipe"] = {"name": "import", **about.get("recipe", {}), **references.recipe()}
    tables = {} if data.samples is None else {"samples": data.samples}
    tables |= {} if data.dwells is None else {"dwells": data.dwells}
    if judged is not None and judged.coefficients:
        tables |= {"coefficients": pd.DataFrame(judged.coefficients)} | judged.tables
    kind = "import" if judged is None else "import with a fit"
    return keep_tables(kind, source.sha256, parameters, about, tables, archive)
