"""What is to be done to a run of the archive: the stages of the chain for its own job, or those that imported dwells allow."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import pandas as pd
from pydantic import ValidationError

from inertial.quantities import FORCE_COLUMNS
from pipelines.archive import Archive, Run
from pipelines.archive.signatures import ENTRY
from pipelines.chain.chain import RECORDS, STAGES, Tables
from pipelines.chain.runner import captured_tables
from pipelines.diagnosis.diagnose import default_model
from pipelines.importers.exchange import refuse_other_procedures
from pipelines.importers.plane import axis_of_plane
from pipelines.jobs.job import Job
from pipelines.jobs.model_change import ModelChange
from pipelines.jobs.model_files import refuse_unknown_effects, use_formulas
from pipelines.jobs.priors import stored_in
from pipelines.rerun.import_steps import (
    ImportedData,
    StageCall,
    budget_step,
    fit_step,
    grade_step,
    has_poses,
    import_step,
    imported,
    judge_step,
    plane_step,
    verify_step,
    with_effect_files,
    zero_of_import,
)
from pipelines.stages.figures import UNITS
from pipelines.stages.grade import refuse_limits_without_figures
from pipelines.stages.uncertainty.budget_terms import archived_terms
from pipelines.tables.leave_out import Dwells, leave_out
from schemas.errors import DataRejected, WrongUse
from schemas.limits import limits_of
from schemas.lot import Lot
from schemas.recipe import FormulaSpec, Recipe
from schemas.station import StationConfig
from schemas.toml_files import explain
from schemas.units import AXES

PROVENANCE = ("who", "where", "when", "software", "libraries", ENTRY, "rerun_of", "because", "measured")
_REFERENCE = "a fit needs the force at every dwell: import the file again, which adds it at the angles of a table"
_UNIT = "a fit states coefficients in it: import the file again with --unit-of output=g|mg|m/s^2|V|mV|LSB"
_AS_IMPORTED = (
    "a fit needs them: import the file with 'tumbleline import FILE --set rows=dwells --map … --unit-of output=…'"
)
"""What a fit needs of imported dwells, and what to do where they lack it."""


@dataclass(frozen=True)
class ArchivedJob(Job):
    """The job of an archived run, which opens no station: what the run tells of its capture and station stays as it is.

    run_document : what ``run.json`` holds, without who made it, where and when
    """

    run_document: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def about(self) -> dict[str, Any]:
        """The content of ``run.json`` that describes the run to readers."""
        decided = {"recipe": self.recipe.model_dump(mode="json"), "limits": self.limits.model_dump(mode="json")}
        return {**self.run_document, **decided, "lot": self.lot.model_dump(mode="json")}


def archived_job(run: Run, change: ModelChange) -> ArchivedJob:
    """The job of a captured run, with another model or other limits where they are given."""
    about, keys = run.about, model_keys(change)
    if keys:  # the prior of another model does not fit this model
        about["recipe"]["prior"] = None
        about.pop("prior", None)
    try:
        recipe = Recipe.model_validate({**about["recipe"], **keys})
        limits = change.limits or limits_of(about["limits"], UNITS)
        lot = Lot.model_validate(about["lot"])
    except ValidationError as problem:
        raise explain(problem, f"run {run.id}", Recipe) from None
    if change.limits is not None:
        recipe = recipe.model_copy(update={"limits": change.limits_name})
    station = StationConfig.model_construct(**about.get("station", {}))
    prior, document = stored_in(about), without_provenance(about)
    job = ArchivedJob(recipe, limits, lot, station, about["capture"], prior=prior, run_document=document)
    refuse_unknown_effects(recipe.effects, f"run {run.id}")
    refuse_limits_without_figures(limits, recipe)
    return job


def without_provenance(about: dict[str, Any]) -> dict[str, Any]:
    """The content of ``run.json`` without author, host and time."""
    return {key: value for key, value in about.items() if key not in PROVENANCE}


def model_keys(change: ModelChange) -> dict[str, Any]:
    """The keys of a recipe that another model changes; none where the model stays."""
    keys = change.of_model()
    return {**keys, "formulas": [f.model_dump(mode="json") for f in change.formulas]} if keys else {}


CAPTURED = ("readings", "history")
FROM_SAMPLES = (
    "validate",
    "reduce",
    "soak_noise",
)  # stages whose tables are reused where the raw samples are no longer there
RAW = (*FROM_SAMPLES, "noise")  # stages that read the raw samples


@dataclass(frozen=True)
class Plan:
    """The stages of a re-run, in order.

    name : begins the new run's name; about : the content of its ``run.json``; decisive : what its result depends on
    """

    name: str
    steps: tuple[StageCall, ...]
    about: dict[str, Any]
    decisive: dict[str, Any]


def plan_of(run: Run, change: ModelChange, left_out: Dwells = ()) -> Plan:
    """The plan of a re-run, with another model or other limits where they are given.

    left_out : dwells of an import that are left out, as (unit, dwell)
    """
    if run.about.get("capture"):
        if left_out:
            raise WrongUse(f"run {run.id}: --leave-out is for imports, this run was captured; measure the dwell again")
        return _captured(run, change)
    return _imported(run, change, left_out)


def _captured(run: Run, change: ModelChange) -> Plan:
    job = archived_job(run, change)
    steps = [_capture_step(run, job)]
    complete = run.records is not None and run.records.is_complete()
    for stage in STAGES:
        if stage.name == "soak_noise" and not complete and stage.outputs[0] not in run.tables():
            continue  # a run of an earlier version whose samples are gone
        keyed = with_effect_files(stage.name, stage.parameters(job))
        steps.append(StageCall(stage.name, stage.inputs, stage.outputs, *keyed, partial(stage.call, job)))
    decisive = {key: value for key, value in job.about.items() if key != "station"}
    return Plan(job.recipe.name, tuple(steps), job.about, {**decisive, "code": {s.name: s.code for s in steps[1:]}})


def _capture_step(run: Run, job: ArchivedJob) -> StageCall:
    """The step that takes over the tables of the capture: those that the run has, fewer for runs of earlier versions."""
    there = run.tables()
    more = tuple(name for name in ("events", "soaks") if name in there or "readings" not in there)

    def gathered(new: Run) -> Tables:
        tables = captured_tables(Archive(new.archive.root).capture(job.capture_id))
        return {name: tables[name] for name in (*CAPTURED, *more)}

    return StageCall("capture", (RECORDS,), (*CAPTURED, *more), {"capture": job.capture_id}, "", gathered)


def _imported(run: Run, change: ModelChange, left_out: Dwells) -> Plan:
    """Fit, verification and, where limits are known, grades of dwells that were imported."""
    about = run.about
    dwells = _fit_for_a_fit(run)
    dwells = leave_out(dwells, left_out)
    data = imported(run, dwells)
    across = None if change.effects or about.get("recipe", {}).get("effects") else axis_of_plane(dwells)
    if across is not None:
        return _in_a_plane(run, change, left_out, across, data)
    model = _model_of(run, dwells, change)
    use_formulas([FormulaSpec.model_validate(f) for f in model["formulas"]], f"run {run.id}")
    refuse_unknown_effects(model["effects"], f"run {run.id}")
    limits = change.limits or (limits_of(about["limits"], UNITS) if about.get("limits") else None)
    stated = {"limits": limits.model_dump(mode="json") if limits else None}
    steps = [import_step(data, left_out, run), fit_step(model, data), judge_step(model, data), verify_step(data)]
    terms = archived_terms({**about, **(stated if limits else {})})
    steps += [budget_step(terms, data)] if terms else []
    steps += [grade_step(limits, zero_of_import(about), budgeted=terms is not None)] if limits else []
    recipe = {**model, **({"limits": change.limits_name} if change.limits else {})}
    hashes = {name: run.manifest(name)["sha256"] for name in data.read()}
    code = {step.name: step.code for step in steps}
    return _import_plan(run, steps, left_out, recipe, stated, {"data": hashes, "model": model, **stated, "code": code})


def _in_a_plane(run: Run, change: ModelChange, left_out: Dwells, across: int, data: ImportedData) -> Plan:
    """The fit of a unit that was turned about one of its axes: its default model is of the two axes in the plane."""
    axis = AXES[across]
    if change.limits is not None:
        raise WrongUse(
            f"run {run.id}: turned about {axis} alone, limits need the scale of {axis} too; measure other orientations, or fit "
            "without limits"
        )
    steps = [import_step(data, left_out, run), plane_step(across, data.gravity)]
    hashes = {"dwells": run.manifest("dwells")["sha256"]}
    depends = {"data": hashes, "plane": axis, "code": steps[1].code}
    return _import_plan(run, steps, left_out, {}, {"plane_across": axis}, depends)


def _import_plan(
    run: Run,
    steps: list[StageCall],
    left_out: Dwells,
    recipe: dict[str, Any],
    more: dict[str, Any],
    depends: dict[str, Any],
) -> Plan:
    """The plan of an import; its ``run.json`` and its key state the dwells that are left out."""
    about = run.about
    named = [f"{unit}:{dwell}" for unit, dwell in left_out]
    noted = {"left_out": [*about.get("left_out", []), *named]} if left_out else {}
    about_import = {"recipe": {**about.get("recipe", {}), "name": "import", **recipe}, **more}
    return Plan("import", tuple(steps), {**without_provenance(about), **about_import, **noted}, {**depends, **noted})


def _fit_for_a_fit(run: Run) -> pd.DataFrame:
    """The run's dwells, refused where the fit of a lot has nothing to work with."""
    refuse_other_procedures(run, "dwells")
    if "dwells" not in run.tables():
        raise DataRejected(
            f"run {run.id}: imported without dwells, a fit needs them; import it with poses, a face or block_s"
        )
    dwells = run.table("dwells")
    by_reason = {_UNIT: ("out_unit",), _AS_IMPORTED: ("kind", "pose")}
    if has_poses(dwells):
        by_reason = {_REFERENCE: FORCE_COLUMNS, **by_reason}
    for reason, needed in by_reason.items():
        missing = [name for name in needed if name not in dwells.columns]
        if missing:
            raise DataRejected(f"run {run.id}: its dwells have no {', '.join(missing)}; {reason.format(run=run.id)}")
    return dwells


def _model_of(run: Run, dwells: pd.DataFrame, change: ModelChange) -> dict[str, Any]:
    known = run.about.get("recipe", {})
    if change.effects is not None:
        return model_keys(change)
    if known.get("effects"):
        return {key: known[key] for key in ("effects", "formulas", "model_name", "model_version")}
    return {"effects": default_model(dwells), "formulas": [], "model_name": "", "model_version": 0}
