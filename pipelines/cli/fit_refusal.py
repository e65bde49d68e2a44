"""Why the recipe of a run cannot fit a model that a diagnosis of its dwells recommends."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.archive import Run


def fit_refusal(run: Run, effects: Sequence[str]) -> str:
    """What a run's recipe lacks to fit a model, and why its dwells show the model none the less; empty where it lacks nothing."""
    from pipelines.jobs.job import job_of_run
    from pipelines.planning.plan import missing
    from pipelines.planning.shown_by_verification import OF_VERIFICATION, REMEDY, shown_by_verification
    from pipelines.schedule.planned_state import state_of
    from pipelines.schedule.steps import steps
    from pipelines.schedule.timing import schedule

    job = job_of_run(run)
    recipe = job.recipe.model_copy(update={"effects": list(effects)})
    activities = schedule(steps(recipe), job.station, recipe)
    text = missing(state_of(activities, job.station, recipe, history=True), effects)
    if not text:
        return ""
    named = [effect for effect in effects if f"{effect} cannot be identified" in text]
    checked = sorted(shown_by_verification(activities, job.station, recipe, named))
    also = f"; {', '.join(checked)}: {OF_VERIFICATION}; {REMEDY}" if checked else ""
    return f"Recipe {recipe.name} cannot fit this model: {text}{also}."
