"""Whether the model of a run is adequate: the verdict of its archive."""

from pipelines.archive import Run
from pipelines.importers.exchange import dwells_of_run, history_of_run
from pipelines.jobs.model_files import use_formulas_of
from pipelines.stages.judge import AdequacyDocument, verdict_of, verdict_on

_judged: dict[tuple[str, ...], AdequacyDocument] = {}
"""The verdict on the last run of a version without the table: report and last line of one command need it once."""


def adequacy_of(run: Run) -> AdequacyDocument | None:
    """The verdict on the model of a run; None where it has no model to judge.

    A run of an earlier version has no table of it, and is judged as a new one is; an import of an earlier version has none.
    """
    tables = run.tables()
    if "verdict" in tables:
        return verdict_of(run.table("verdict"))
    about = run.about
    recipe = about.get("recipe", {})
    if not (about.get("capture") and "dwells" in tables and recipe.get("poses") and recipe.get("effects")):
        return None
    parts = [name for name in ("dwells", "history") if name in tables]
    formulas = [str(formula) for formula in recipe.get("formulas", ())]
    key = (*(run.manifest(name)["sha256"] for name in parts), *recipe["effects"], *formulas)
    if key not in _judged:
        use_formulas_of(run)
        verdict = verdict_on(dwells_of_run(run), history_of_run(run) if "history" in parts else None, recipe["effects"])
        _judged.clear()
        _judged[key] = verdict
    return _judged[key]
