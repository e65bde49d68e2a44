"""What is to be done to a run of the archive: the stages of the chain for its own job, or those that imported dwells allow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS
from pipelines.archive import Archive, Run, code_hash
from pipelines.chain.chain import BY_NAME, RECORDS, STAGES, Stage, Tables
from pipelines.chain.runner import captured_tables
from pipelines.diagnosis.diagnose import default_model
from pipelines.importers.plane import axis_of_plane
from pipelines.jobs.job import Job
from pipelines.jobs.model_change import ModelChange
from pipelines.jobs.model_files import refuse_unknown_effects, use_formulas
from pipelines.jobs.terms import archived_terms
from pipelines.rerun.archived_job import ArchivedJob, archived_job, model_keys, without_provenance
from pipelines.rerun.import_steps import (
    StageCall,
    budget_step,
    judge_step,
    no_noise,
    plane_step,
    recorded_history,
    verify_norms_step,
)
from pipelines.stages.figures import UNITS
from pipelines.stages.fit import fit
from pipelines.stages.grade import GradeEvidence, grade
from pipelines.stages.unknown_poses.fit import fit_of_norms
from pipelines.stages.verify import verify
from pipelines.tables.leave_out import Dwells, leave_out
from schemas.errors import DataRejected, WrongUse
from schemas.limits import Limits, limits_of
from schemas.recipe import FormulaSpec
from schemas.units import AXES, STANDARD_GRAVITY_M_S2

CAPTURED = ("readings", "history")
RAW = ("validate", "reduce", "noise")
"""Stages that read the raw samples."""


@dataclass(frozen=True)
class Plan:
    """All that is to be done to a run.

    name : begins the new run's name; about : what it is kept with; decisive : what its result depends on
    """

    name: str
    steps: tuple[StageCall, ...]
    about: dict[str, Any]
    decisive: dict[str, Any]


def plan_of(run: Run, change: ModelChange, left_out: Dwells = ()) -> Plan:
    """What is to be done to a run, with another model or other limits where they are given.

    Parameters
    ----------
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
    for stage in STAGES:
        call = _called(stage.call, job)
        steps.append(
            StageCall(stage.name, stage.inputs, stage.outputs, stage.parameters(job), code_hash(stage.name), call)
        )
    code = {stage.name: code_hash(stage.name) for stage in STAGES}
    decisive = {key: value for key, value in job.about.items() if key != "station"}
    return Plan(job.recipe.name, tuple(steps), job.about, {**decisive, "code": code})


def _called(call: Callable[[Job, Run], Tables], job: Job) -> Callable[[Run], Tables]:
    return lambda run: call(job, run)


def _capture_step(run: Run, job: ArchivedJob) -> StageCall:
    """What the run keeps of its capture: all that it has, which for runs of earlier versions is less than today."""
    there = run.tables()
    more = tuple(name for name in ("events", "soaks") if name in there or "readings" not in there)

    def gathered(new: Run) -> Tables:
        tables = captured_tables(Archive(new.archive.root).capture(job.capture_id))
        return {name: tables[name] for name in (*CAPTURED, *more)}

    return StageCall("capture", (RECORDS,), (*CAPTURED, *more), {"capture": job.capture_id}, "", gathered)


def _imported(run: Run, change: ModelChange, left_out: Dwells) -> Plan:
    """Fit, verification and, where limits are known, grades of dwells that were imported."""
    about = run.about
    dwells = leave_out(_fit_for_a_fit(run), left_out)
    known = has_poses(dwells)
    across = None if change.effects or about.get("recipe", {}).get("effects") else axis_of_plane(dwells)
    if across is not None:
        return _in_a_plane(run, change, left_out, across)
    model = _model_of(run, dwells, change)
    use_formulas([FormulaSpec.model_validate(f) for f in model["formulas"]], f"run {run.id}")
    refuse_unknown_effects(model["effects"], f"run {run.id}")
    limits = change.limits or (limits_of(about["limits"], UNITS) if about.get("limits") else None)
    history = "history" in run.tables()
    gravity = gravity_of_import(about)
    steps = [_import_step(history, left_out, run), _fit_step(model, history, None if known else gravity)]
    steps.append(judge_step(model, history=history, known=known))
    steps += [_verify_step(history)] if known else [verify_norms_step(gravity, history=history)]
    terms = archived_terms({**about, "limits": limits.model_dump(mode="json") if limits else about.get("limits")})
    steps += [budget_step(terms, history=history, known=known)] if terms else []
    zero = float((about.get("mapping") or {}).get("zero_output", 0.0))
    steps += [_grade_step(limits, zero, budgeted=terms is not None)] if limits else []
    recipe = {**about.get("recipe", {}), "name": "import", **model}
    recipe |= {"limits": change.limits_name} if change.limits else {}
    kept = without_provenance(about)
    new = {**kept, "recipe": recipe, "limits": limits.model_dump(mode="json") if limits else None}
    data = {name: run.manifest(name)["sha256"] for name in ("dwells", "history") if name != "history" or history}
    code = {step.name: step.code for step in steps}
    decisive = {"data": data, "model": model, "limits": new["limits"], "code": code}
    _note_left_out(about, left_out, new, decisive)
    return Plan("import", tuple(steps), new, decisive)


def _in_a_plane(run: Run, change: ModelChange, left_out: Dwells, across: int) -> Plan:
    """The fit of a unit that was turned about one of its axes: its default model is of the two axes in the plane."""
    about, axis = run.about, AXES[across]
    if change.limits is not None:
        raise WrongUse(
            f"run {run.id}: turned about {axis} alone, limits need the scale of {axis} too; measure other orientations, or fit "
            "without limits"
        )
    history = "history" in run.tables()
    gravity = gravity_of_import(about)
    steps = (_import_step(history, left_out, run), plane_step(across, gravity))
    kept = without_provenance(about)
    new: dict[str, Any] = {**kept, "recipe": {**about.get("recipe", {}), "name": "import"}, "plane_across": axis}
    decisive: dict[str, Any] = {
        "data": {"dwells": run.manifest("dwells")["sha256"]},
        "plane": axis,
        "code": steps[1].code,
    }
    _note_left_out(about, left_out, new, decisive)
    return Plan("import", steps, new, decisive)


def _note_left_out(about: dict[str, Any], left_out: Dwells, new: dict[str, Any], decisive: dict[str, Any]) -> None:
    """Adds the dwells that are left out to what a run is kept with and to what its result depends on."""
    if left_out:
        named = [f"{unit}:{dwell}" for unit, dwell in left_out]
        decisive["left_out"] = new["left_out"] = [*about.get("left_out", []), *named]


def has_poses(dwells: pd.DataFrame) -> bool:
    """Whether dwells have a reference, force or angles; otherwise only the norm of gravity is known."""
    return any(set(names) <= set(dwells.columns) for names in (FORCE_COLUMNS, ANGLE_COLUMNS))


def gravity_of_import(about: dict[str, Any]) -> float:
    """Gravity where an import was measured, g; the standard value where it was not given."""
    given = (about.get("mapping") or {}).get("local_gravity_m_s2")
    return 1.0 if given is None else float(given) / STANDARD_GRAVITY_M_S2


def _fit_for_a_fit(run: Run) -> pd.DataFrame:
    """The run's dwells, refused where the fit of a lot has nothing to work with."""
    if "dwells" not in run.tables():
        raise DataRejected(
            f"run {run.id}: imported without dwells, a fit needs them; import it with poses, a face or --blocks"
        )
    dwells = run.table("dwells")
    needed = ("kind", "pose", "out_unit")
    if has_poses(dwells):
        needed = (*FORCE_COLUMNS, "sd_x", "sd_y", "sd_z", "n", *needed)
    missing = [name for name in needed if name not in dwells.columns]
    if missing:
        raise DataRejected(
            f"run {run.id}: its dwells have no {', '.join(missing)}, a fit of known poses needs them; import it again with these "
            "columns mapped, or judge it with 'tumbleline diagnose'"
        )
    return dwells


def _model_of(run: Run, dwells: pd.DataFrame, change: ModelChange) -> dict[str, Any]:
    known = run.about.get("recipe", {})
    if change.effects is not None:
        return model_keys(change)
    if known.get("effects"):
        return {key: known[key] for key in ("effects", "formulas", "model_name", "model_version")}
    return {"effects": default_model(dwells), "formulas": [], "model_name": "", "model_version": 0}


def _import_step(history: bool, left_out: Dwells, old: Run) -> StageCall:  # noqa: FBT001 - whether the import has one
    names = ("dwells", *(("history",) if history else ()))
    if left_out:
        parameters = {"left_out": [list(one) for one in left_out], "dwells": old.manifest("dwells")["sha256"]}
        others = names[1:]
        return StageCall(
            "leave_out",
            (),
            names,
            parameters,
            "",
            lambda _: {
                "dwells": leave_out(old.table("dwells"), left_out),
                **{name: old.table(name) for name in others},
            },
        )
    return StageCall("import", (), names, {}, "", lambda run: {name: run.table(name) for name in names})


def _inputs(stage: Stage, *, history: bool) -> tuple[str, ...]:
    """Tables that a stage reads of an import, which may have no temperatures between its dwells."""
    return stage.inputs if history else tuple(name for name in stage.inputs if name != "history")


def _fit_step(model: dict[str, Any], history: bool, gravity: float | None) -> StageCall:  # noqa: FBT001
    """The fit of the chain; by the norm of gravity alone where its size is given."""
    stage = BY_NAME["fit"]
    parameters = {"effects": model["effects"], "formulas": model["formulas"]}
    inputs = _inputs(stage, history=history)

    if gravity is not None:

        def of_norms(run: Run) -> Tables:
            past = run.table("history") if history else None
            return fit_of_norms(run.table("dwells"), past, model["effects"], gravity)

        code = code_hash("fit of norms")
        return StageCall("fit", inputs, stage.outputs, {**parameters, "gravity_g": gravity}, code, of_norms)

    def call(run: Run) -> Tables:
        return fit(run.table("dwells"), recorded_history(run), model["effects"])

    return StageCall("fit", inputs, stage.outputs, parameters, code_hash(stage.name), call)


def _verify_step(history: bool) -> StageCall:  # noqa: FBT001
    stage = BY_NAME["verify"]
    inputs = _inputs(stage, history=history)

    def call(run: Run) -> Tables:
        names = ("coefficients", "covariance", "predictions")
        return verify(run.table("dwells"), recorded_history(run), *(run.table(name) for name in names))

    return StageCall("verify", inputs, stage.outputs, {}, code_hash(stage.name), call)


def _grade_step(limits: Limits, zero: float, *, budgeted: bool) -> StageCall:
    stage = BY_NAME["grade"]
    names = ("coefficients", "covariance", "residuals", "verification", "verification_poses")
    names = (*names, "uncertainties", "budget_covariance") if budgeted else names

    def call(run: Run) -> Tables:
        tables: dict[str, Any] = {name: run.table(name) for name in names}
        units = list(dict.fromkeys(tables["coefficients"]["unit"].astype(str)))
        sound = {"unit": units, "slot": range(len(units)), "refused": False, "fault": "", "reason": ""}
        return grade(GradeEvidence(verdicts=pd.DataFrame(sound), **tables, noise=no_noise()), limits, zero)

    parameters = {"limits": limits.model_dump(mode="json"), **({"zero_output": zero} if zero else {})}
    return StageCall("grade", names, stage.outputs, parameters, code_hash(stage.name), call)
