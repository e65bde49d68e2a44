"""Imports in the archive: each is a run, named by the hash of its inputs, whose tables name source, parameters and code."""

from __future__ import annotations

from collections.abc import Mapping as Parameters
from typing import Any

import pandas as pd

from pipelines.archive import Archive, Run, code_hash, stage_key
from pipelines.importers.files import SourceFile
from pipelines.importers.judged import FitAnswer
from pipelines.importers.mapping import Mapping
from pipelines.importers.record import Imported
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
    run = Archive(archive).open_run("import", about, {"key": key})
    if not run.has(tuple(tables), key):
        run.save("import", key, tables, {"inputs": inputs, "parameters": parameters, "code": code})
    run.seal()
    return run


def lot_of_import(units: list[str]) -> dict[str, Any]:
    """The lot of an import: its units, and no device."""
    return {"device": "imported", "units": [{"serial": unit, "slot": 0} for unit in units]}


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
        "name": f"import of {', '.join(data.units[:3])}", "source": source.as_dict(), "mapping": parameters["mapping"],
        "remarks": list(data.remarks), "lot": lot_of_import(data.units),
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
    return keep_tables("import", source.sha256, parameters, about, tables, archive)
