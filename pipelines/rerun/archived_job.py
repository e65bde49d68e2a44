"""The job of an archived run, with another model or other limits where they are given."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from pipelines.archive import Run
from pipelines.archive.signatures import ENTRY
from pipelines.jobs.job import Job
from pipelines.jobs.model_change import ModelChange
from pipelines.jobs.model_files import refuse_unknown_effects
from pipelines.stages.figures import UNITS
from pipelines.stages.grade import refuse_limits_without_figures
from schemas.limits import limits_of
from schemas.lot import Lot
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.toml_files import explain

PROVENANCE = ("who", "where", "when", "software", "libraries", ENTRY, "rerun_of", "because", "measured")


@dataclass(frozen=True)
class ArchivedJob(Job):
    """The job of an archived run, which opens no station: what the run tells of its capture and station stays as it is.

    run_document : what ``run.json`` holds, without who made it, where and when
    """

    run_document: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def about(self) -> dict[str, Any]:
        """What is kept beside the run for readers."""
        decided = {"recipe": self.recipe.model_dump(mode="json"), "limits": self.limits.model_dump(mode="json")}
        return {**self.run_document, **decided, "lot": self.lot.model_dump(mode="json")}


def archived_job(run: Run, change: ModelChange) -> ArchivedJob:
    """The job of a captured run, with another model or other limits where they are given."""
    about = run.about
    try:
        recipe = Recipe.model_validate({**about["recipe"], **model_keys(change)})
        limits = change.limits or limits_of(about["limits"], UNITS)
        lot = Lot.model_validate(about["lot"])
    except ValidationError as problem:
        raise explain(problem, f"run {run.id}", Recipe) from None
    if change.limits is not None:
        recipe = recipe.model_copy(update={"limits": change.limits_name})
    run_document = without_provenance(about)
    station = StationConfig.model_construct(**about.get("station", {}))
    capture = about["capture"]
    job = ArchivedJob(
        recipe=recipe, limits=limits, lot=lot, station=station, captured=capture, run_document=run_document
    )
    refuse_unknown_effects(recipe.effects, f"run {run.id}")
    refuse_limits_without_figures(limits, recipe)
    return job


def without_provenance(about: dict[str, Any]) -> dict[str, Any]:
    """What ``run.json`` holds, without who made it, where and when."""
    return {key: value for key, value in about.items() if key not in PROVENANCE}


def model_keys(change: ModelChange) -> dict[str, Any]:
    """The keys of a recipe that another model changes; none where the model stays."""
    keys = change.of_model()
    return {**keys, "formulas": [f.model_dump(mode="json") for f in change.formulas]} if keys else {}
