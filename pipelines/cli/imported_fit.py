"""``tumbleline fit`` of an import: a model fitted to its dwells, with the verdict and its basis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipelines.archive import Run
from pipelines.cli.options import console, error_console, give
from schemas.errors import DONE, PART_FAILED
from schemas.units import AXES

VERDICTS = {
    True: ("adequate", "bold green"),
    False: ("NOT ADEQUATE: this model does not describe these data", "bold red"),
    None: ("CANNOT BE JUDGED: see above", "bold yellow"),
}


def fit_import(run: Run, change: tuple[str, Path | None, str], leave_out: str, *, as_json: bool) -> int:
    """Fit a model to an import, keep it as a run of its own and print it; the exit status.

    Parameters
    ----------
    change : effects, model file and limits; empty or None if not given
    leave_out : dwells as UNIT:DWELL,…
    """
    from pipelines.archive import Archive
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.rerun import again
    from pipelines.tables.leave_out import named_dwells

    effects, model, limits = change
    with error_console().status("fitting and judging"):
        outcome = again(
            Archive(run.archive.root),
            run.id,
            change_from_options(effects, model, limits, where="fit"),
            left_out=named_dwells(leave_out),
        )
        done = Archive(run.archive.root).run(outcome.new)
        document = fit_document(done, run.id)
    give(document, _print, as_json=as_json)
    passed = all(unit["outcome"] == "pass" for unit in document["units"])
    return DONE if document["adequate"] is True and passed else PART_FAILED


def fit_document(done: Run, source: str) -> dict[str, Any]:
    """The result of the fit of an import: verdict, evidence, and decisions if there are limits."""
    from pipelines.diagnosis.imported_norms import fitted
    from pipelines.rerun.import_steps import gravity_of_import, has_poses
    from pipelines.tables.frames import rows_of

    dwells = done.table("dwells")
    if done.about.get("plane_across"):
        return _of_a_plane(done, source)
    past = done.table("history") if "history" in done.tables() else None
    effects = list(done.about["recipe"]["effects"])
    if has_poses(dwells):
        fitted = _known_poses(dwells, past, effects)
    else:
        answer = fitted(dwells, past, effects, gravity_of_import(done.about), str(dwells["out_unit"].iloc[0]))
        fitted = {**answer.document, "lines": list(answer.lines)}
    grades = rows_of(done.table("grades")) if "grades" in done.tables() else []
    keys = ("adequate", "reason", "error", "evidence", "leave_out", "missing", "lines")
    return {
        "run": done.id,
        "fit_of": source,
        "effects": effects,
        "left_out": list(done.about.get("left_out", [])),
        "units": [{key: row[key] for key in ("unit", "outcome", "grade", "reasons")} for row in grades],
        **{key: fitted[key] for key in keys},
    }


def _of_a_plane(done: Run, source: str) -> dict[str, Any]:
    """The document of a fit of the two axes in a plane."""
    from pipelines.importers.plane import plane_answer
    from pipelines.rerun.import_steps import gravity_of_import

    dwells = done.table("dwells")
    across = AXES.index(done.about["plane_across"])
    answer = plane_answer(dwells, across, gravity_of_import(done.about), str(dwells["out_unit"].iloc[0]))
    return {
        "run": done.id,
        "fit_of": source,
        "effects": [],
        "left_out": list(done.about.get("left_out", [])),
        "units": [],
        **{key: answer.document[key] for key in ("adequate", "reason", "error", "open")},
        "evidence": None,
        "leave_out": None,
        "missing": [],
        "lines": list(answer.lines),
    }


def _known_poses(dwells: Any, past: Any, effects: list[str]) -> dict[str, Any]:
    """The verdict on a fit with commanded poses, and its basis as lines."""
    from pipelines.diagnosis.diagnose import diagnose
    from pipelines.diagnosis.sentences import evidence_text, verdict

    document = diagnose(dwells, past, effects)
    document["units"] = list(dict.fromkeys(dwells["unit"].astype(str)))
    missing = [group["effects"] for group in document["classes"] if group["scope"] != "data"]
    return {**document, "missing": missing, "lines": [verdict(document), *filter(None, [evidence_text(document)])]}


def _print(document: dict[str, Any]) -> None:
    out = console()
    left = f", without {', '.join(document['left_out'])}" if document["left_out"] else ""
    model = ", ".join(document["effects"]) or "axes in the plane"
    out.print(f"{model}{left}: kept as run {document['run']}")
    for line in document["lines"]:
        out.print(f"  {line}")
    for unit in document["units"]:
        reasons = f" ({unit['reasons']})" if unit["reasons"] else ""
        out.print(f"  {unit['unit']}: {unit['outcome']}, grade {unit['grade']}{reasons}")
    text, style = VERDICTS[document["adequate"]]
    out.print(f"  {text}", style=style)
