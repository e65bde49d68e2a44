"""The report of an import that was fitted: its coefficients, its verdict with pictures, and the basis of the verdict."""

from __future__ import annotations

from typing import Any

from pipelines.archive import Run
from schemas.errors import WrongUse

GRADED = ("grades", "figures", "budget", "uncertainties", "verification", "lot_risks")


def make_imported_report(run: Run) -> bool:
    """Write the report of an import if it is missing or older than its tables; return whether it was up to date.

    Raises
    ------
    WrongUse
        The run has no coefficients, or none of a model of the catalogue.
    """
    from pipelines.archive import code_hash, stage_key
    from pipelines.cli.diagnose import diagnosed
    from pipelines.jobs.model_files import use_formulas_of
    from pipelines.report.imported import certificates_of, decisions
    from pipelines.stages.unknown_poses.fit import fitted_dwells
    from pipelines.tables.frames import rows_of

    effects = list((run.about.get("recipe") or {}).get("effects", ()))
    names = ("dwells", "coefficients")
    if axis := run.about.get("plane_across"):
        raise WrongUse(
            f"report: run {run.id} was turned about {axis} alone and has coefficients of the axes in the plane only; "
            f"'tumbleline fit {run.id}' prints them"
        )
    if not effects or not set(names) <= set(run.tables()):
        raise WrongUse(
            f"report: run {run.id} was imported and not fitted, coefficients are needed; fit it with 'tumbleline fit {run.id} "
            "--effects bias,scale,misalignment' then give this command for the new run"
        )
    use_formulas_of(run)
    past = run.table("history") if "history" in run.tables() else None
    judged = [name for name in GRADED if name in run.tables()]
    inputs, code = {name: run.manifest(name)["sha256"] for name in (*names, *judged)}, code_hash("report of an import")
    parameters: dict[str, Any] = {"effects": effects}
    if given := certificates_of(run):
        parameters["certificates"] = {unit: list(one) for unit, one in sorted(given.items())}
    key = stage_key("report", inputs, parameters, code)
    if run.has_report(key):
        run.seal()
        return True
    rows = rows_of(run.table("coefficients"))
    _, page = diagnosed(
        fitted_dwells(run.table("dwells")), past, effects, f"run {run.id}", with_report=True, coefficients=rows
    )
    page = page.replace("</body>", f"{decisions(run)}</body>")
    run.save_report(key, page, {"inputs": inputs, "parameters": parameters, "code": code})
    return False
