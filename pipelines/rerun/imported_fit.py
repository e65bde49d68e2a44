"""The result of the fit of an import: verdict, evidence, and decisions if there are limits."""

from typing import Any

import pandas as pd

from pipelines.archive import Run
from pipelines.diagnosis.diagnose import diagnose
from pipelines.diagnosis.imported_norms import fitted
from pipelines.diagnosis.sections import fault_lines
from pipelines.diagnosis.sentences import evidence_text, verdict
from pipelines.importers.plane import plane_answer
from pipelines.rerun.documents import ImportedFitDocument
from pipelines.rerun.import_steps import gravity_of_import, has_poses
from pipelines.tables.dwells import lacking
from pipelines.tables.frames import rows_of
from schemas.units import AXES


def fit_document(done: Run, source: str) -> ImportedFitDocument:
    """The result of the fit of an import: verdict, evidence, and decisions if there are limits."""
    dwells, plane = done.table("dwells"), done.about.get("plane_across")
    past = done.table("history") if "history" in done.tables() else None
    effects = [] if plane else list(done.about["recipe"]["effects"])
    if not plane and has_poses(dwells):
        judged = _known_poses(dwells, past, effects)
    else:
        known = gravity_of_import(done.about), str(dwells["out_unit"].iloc[0])
        answer = plane_answer(dwells, AXES.index(plane), *known) if plane else fitted(dwells, past, effects, *known)
        judged = {"evidence": None, "leave_out": None, "missing": [], **answer.document, "lines": list(answer.lines)}
    grades = rows_of(done.table("grades")) if "grades" in done.tables() and not plane else []
    units = [{key: row[key] for key in ("unit", "outcome", "grade", "reasons")} for row in grades]
    keys = ("adequate", "reason", "error", "evidence", "leave_out", "missing", "lines", *(["open"] if plane else []))
    document: Any = {
        "run": done.id,
        "fit_of": source,
        "effects": effects,
        "left_out": list(done.about.get("left_out", [])),
        "units": units,
        **{key: judged[key] for key in keys},
        "faulty": sorted({unit for fault in judged.get("blocked_by", ()) for unit in fault["units"]}),
    }
    return document


def _known_poses(dwells: pd.DataFrame, past: pd.DataFrame | None, effects: list[str]) -> dict[str, Any]:
    """The verdict on a fit with commanded poses, and its basis as lines."""
    document = diagnose(dwells, past, effects)
    document["units"] = list(dict.fromkeys(dwells["unit"].astype(str)))
    missing = [group["effects"] for group in document["classes"] if group["scope"] != "data"]
    lines = [verdict(document), *fault_lines(document), evidence_text(document), lacking(dwells)]
    return {**document, "missing": missing, "lines": [*filter(None, lines)]}
