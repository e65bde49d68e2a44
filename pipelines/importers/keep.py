"""Imports in the archive: a new run, named after the unit and the hash of its inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from pipelines.archive import Archive, Run, code_hash, stage_key
from pipelines.importers.files import SourceFile
from pipelines.importers.judged import FitAnswer
from pipelines.importers.mapping import Mapping
from schemas.import_references import ImportReferences

if TYPE_CHECKING:
    from pipelines.importers.record import Imported


def keep(
    data: Imported,
    source: SourceFile,
    how: Mapping,
    judged: FitAnswer | None,
    archive: str | None,
    references: ImportReferences | None = None,
) -> Run:
    """The run that holds the import: samples, dwells and coefficients, each with a manifest that names the source.

    Parameters
    ----------
    references : what is stated of the references of the measurement; None: noise only
    """
    inputs = {"source": source.sha256}
    parameters = {"mapping": how.model_dump(mode="json"), "fit": None if judged is None else judged.method}
    code = code_hash("import")
    if references is not None:
        parameters["references"] = references.model_dump(mode="json")
    key = stage_key("import", inputs, parameters, code)
    about: dict[str, Any] = {"name": f"import of {', '.join(data.units[:3])}", "source": source.as_dict()}
    about |= {"mapping": parameters["mapping"], "remarks": list(data.remarks)}
    about["lot"] = {"device": "imported", "units": [{"serial": unit, "slot": 0} for unit in data.units]}
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
    run = Archive(archive).open_run("import", about, {"key": key})
    tables: dict[str, pd.DataFrame | None] = {"samples": data.samples, "dwells": data.dwells}
    if judged is not None and judged.coefficients:
        tables["coefficients"] = pd.DataFrame(judged.coefficients)
        tables |= judged.tables
    there = {name: frame for name, frame in tables.items() if frame is not None}
    if not run.has(tuple(there), key):
        run.save("import", key, there, {"inputs": inputs, "parameters": parameters, "code": code})
    run.seal()
    return run
