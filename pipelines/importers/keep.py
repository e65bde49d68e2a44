"""Imports in the archive: a new run, named after the unit and the hash of its inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from pipelines.archive import Archive, code_hash, stage_key

if TYPE_CHECKING:
    from pipelines.archive import Run
    from pipelines.importers.files import SourceFile
    from pipelines.importers.judged import FitAnswer
    from pipelines.importers.mapping import Mapping
    from pipelines.importers.record import Imported


def keep(data: Imported, source: SourceFile, how: Mapping, judged: FitAnswer | None, archive: str | None) -> Run:
    """The run that holds the import: samples, dwells and coefficients, each with a manifest that names the source."""
    inputs = {"source": source.sha256}
    parameters = {"mapping": how.model_dump(mode="json"), "fit": None if judged is None else judged.method}
    code = code_hash(("pipelines.importers", "pipelines.tables.norms", "inertial.fits", "inertial.static_intervals"))
    key = stage_key("import", inputs, parameters, code)
    about: dict[str, Any] = {"name": f"import of {', '.join(data.units[:3])}", "source": source.as_dict()}
    about |= {"mapping": parameters["mapping"], "remarks": list(data.remarks)}
    about["lot"] = {"device": "imported", "units": [{"serial": unit, "slot": 0} for unit in data.units]}
    if judged is not None and judged.effects:
        model = {"effects": list(judged.effects), "formulas": [], "model_name": "", "model_version": 0}
        about["recipe"] = {"name": "import", **model}
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
