"""The stages of the chain, in order: what each reads, what it writes, its parameters; ``archive/code.py`` has their code."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from pipelines.archive import Records, Run
from pipelines.jobs.job import Job
from pipelines.jobs.priors import family
from pipelines.stages.fit import fit_tables
from pipelines.stages.grade import GradeEvidence, grade
from pipelines.stages.judge import judge
from pipelines.stages.noise import noise, static_record
from pipelines.stages.procedures import procedures
from pipelines.stages.reduce import reduce
from pipelines.stages.soak_noise import soak_noise
from pipelines.stages.uncertainty.budget import budget
from pipelines.stages.uncertainty.budget_terms import BudgetTables
from pipelines.stages.validate import validate
from pipelines.stages.verify import verify_tables
from pipelines.tables.dwells import LotTables
from pipelines.tables.summaries import PROCEDURE, summarised

Tables = dict[str, "pd.DataFrame"]
RECORDS = "records"
NOT_OF_PROCEDURES = ("limits", "effects", "model_name", "model_version", "formulas", "description", "units", "seed")


@dataclass(frozen=True)
class Stage:
    """One stage of the chain.

    inputs : tables it reads; ``records`` are the captured samples
    parameters : what it is called with besides tables, JSON-able: part of its key
    """

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: Callable[[Job], dict[str, Any]]
    call: Callable[[Job, Run], Tables]


def _records(run: Run) -> Records:
    records = run.records
    if records is None:
        raise LookupError(f"run {run.id} has no captured records")
    return records


_looked_at: dict[tuple[str, str, float], pd.DataFrame] = {}
"""Summaries of the samples of the last run whose stages were worked out: they are decoded once for all stages of a run."""


def _summaries(job: Job, run: Run) -> pd.DataFrame:
    """The summaries of a run's samples; samples that change have another hash."""
    records = _records(run)
    key = (str(records.path), records.hash(), job.recipe.zero_output)
    summaries = _looked_at.get(key)
    if summaries is None:
        readings = run.table("readings")
        tumbled = set(readings.loc[readings["kind"] != PROCEDURE, "record"])
        selection = None if len(tumbled) == readings["record"].nunique() else tumbled
        summaries = summarised(records.samples(selection), readings, job.recipe.zero_output, job.recipe.sensor_axes)
        _looked_at.clear()
        _looked_at[key] = summaries
    return summaries


def _reduce(job: Job, run: Run) -> Tables:
    tables = run.table("readings"), run.table("verdicts")
    gravity, follows = job.recipe.local_gravity_m_s2, job.terms.follows
    return {"dwells": reduce(_summaries(job, run), *tables, gravity, follows)}


def _reduced_with(job: Job) -> dict[str, Any]:
    follows = job.terms.follows
    supply = {} if follows is None else {"supply": follows._asdict()}
    return {"local_gravity_m_s2": job.recipe.local_gravity_m_s2, **supply}


_converted: dict[tuple[str, str, str], LotTables] = {}
"""The dwells of the last run whose stages were worked out: fit, verification and budget convert them once."""


def _lot(run: Run) -> LotTables:
    """The dwells of a run with their history; tables that change have another hash."""
    dwells, history = (run.manifest(name)["sha256"] for name in ("dwells", "history"))
    key = (str(run.path), dwells, history)
    lot = _converted.get(key)
    if lot is None:
        lot = LotTables(run.table("dwells"), run.table("history"))
        _converted.clear()  # the stages of another run may do the same in another thread: what is returned is the local one
        _converted[key] = lot
    return lot


_VERIFIED = ("dwells", "history", "coefficients", "covariance", "predictions")


def _judge(job: Job, run: Run) -> Tables:
    return judge(run.table("dwells"), run.table("history"), job.recipe.effects if job.recipe.tumbles else ())


def _verify(job: Job, run: Run) -> Tables:
    coefficients, covariance, predictions = (run.table(name) for name in _VERIFIED[2:])
    return verify_tables(_lot(run), coefficients, covariance, predictions)


def static_inputs(run: Run) -> tuple[Iterable[pd.DataFrame], *tuple[pd.DataFrame, ...]]:
    """The samples of the static record of a captured run, its readings, and the tables that calibrate it."""
    readings, *tables = (run.table(name) for name in ("readings", "coefficients", "covariance", "history"))
    static = set(readings.loc[readings["kind"] == "allan", "record"])
    return _records(run).samples(static), readings, *tables


def _soak_noise(_: Job, run: Run) -> Tables:
    readings, *tables = (run.table(name) for name in ("readings", "coefficients", "covariance"))
    dwells = set(readings.loc[~readings["kind"].isin(["allan", PROCEDURE]), "record"])
    # the samples are decoded only where there are soaks to compare
    samples = _records(run).samples(dwells) if readings["soak"].max() > readings["soak"].min() else ()
    return soak_noise(samples, readings, *tables)


_BUDGETED = (
    *("dwells", "history", "coefficients", "covariance", "wander", "verification", "verification_poses", "noise"),
    "prior",
)


def _budget(job: Job, run: Run) -> Tables:
    lot = _lot(run)
    fitted = (run.table(name) for name in _BUDGETED[2:])
    results = run.table("procedure_results")
    tables = BudgetTables(lot.dwells, lot.history, *fitted, lot=lot, calibration=None, results=results)
    return budget(tables, job.terms)


_EVIDENCE = (
    *("verdicts", "coefficients", "covariance", "residuals", "verification", "verification_poses", "noise"),
    *("uncertainties", "budget_covariance"),
    "procedure_figures",
)


def _grade(job: Job, run: Run) -> Tables:
    readings = run.table("readings").drop_duplicates("unit")
    full_scale = dict(zip(readings["unit"].astype(str), readings["full_scale"].astype(float), strict=True))
    tables = {name: run.table(name) for name in _EVIDENCE}
    evidence = GradeEvidence(**tables, full_scale=full_scale, calibration=None, budget=None)
    return grade(evidence, job.limits, job.recipe.zero_output, tumbles=job.recipe.tumbles)


def _procedures(job: Job, run: Run) -> Tables:
    tables = (run.table(name) for name in ("readings", "verdicts", "coefficients", "covariance", "noise"))
    return procedures(job.recipe, _records(run).samples, *tables)


def _model(job: Job) -> dict[str, Any]:
    return {
        "effects": job.recipe.effects,
        "formulas": [f.model_dump(mode="json") for f in job.recipe.formulas],
    }


def _listed(job: Job) -> dict[str, Any]:
    if not job.recipe.procedures:
        return {}
    return {"recipe": job.recipe.model_dump(mode="json", exclude=set(NOT_OF_PROCEDURES))}


STAGES: tuple[Stage, ...] = (
    Stage(
        name="validate",
        inputs=(RECORDS, "readings"),
        outputs=("verdicts",),
        parameters=lambda job: {"lot": job.lot.model_dump(mode="json"), "zero_output": job.recipe.zero_output},
        call=lambda job, run: {"verdicts": validate(_summaries(job, run), run.table("readings"), job.lot.units)},
    ),
    Stage(
        name="reduce",
        inputs=(RECORDS, "readings", "verdicts"),
        outputs=("dwells",),
        parameters=_reduced_with,
        call=_reduce,
    ),
    Stage(
        name="fit",
        inputs=("dwells", "history"),
        outputs=("coefficients", "covariance", "residuals", "predictions", "wander", "prior"),
        parameters=lambda job: _model(job) | ({} if job.prior is None else {"prior": job.prior.model_dump()}),
        call=lambda job, run: fit_tables(_lot(run), job.recipe.effects, family(job.prior)),
    ),
    Stage(
        name="judge",
        inputs=("dwells", "history"),
        outputs=("verdict",),
        parameters=_model,
        call=_judge,
    ),
    Stage(
        name="verify",
        inputs=_VERIFIED,
        outputs=("verification", "verification_poses"),
        parameters=lambda _: {},
        call=_verify,
    ),
    Stage(
        name="noise",
        inputs=(RECORDS, "readings", "coefficients", "covariance", "history"),
        outputs=("allan", "noise"),
        parameters=lambda _: {},
        call=lambda _, run: noise(static_record(*static_inputs(run))),
    ),
    Stage(
        name="soak_noise",
        inputs=(RECORDS, "readings", "coefficients", "covariance"),
        outputs=("soak_noise", "noise_temperature"),
        parameters=lambda _: {},
        call=_soak_noise,
    ),
    Stage(
        name="procedures",
        inputs=(RECORDS, "readings", "verdicts", "coefficients", "covariance", "noise"),
        outputs=(
            "procedure_points",
            "procedure_figures",
            "procedure_findings",
            "procedure_results",
            "procedure_curves",
        ),
        parameters=_listed,
        call=_procedures,
    ),
    Stage(
        name="budget",
        inputs=(*_BUDGETED, "procedure_results"),
        outputs=("budget", "uncertainties", "budget_covariance"),
        parameters=lambda job: job.terms.document(),
        call=_budget,
    ),
    Stage(
        name="grade",
        inputs=(*_EVIDENCE, "readings"),
        outputs=("figures", "grades", "lot_risks"),
        parameters=lambda job: {
            "limits": job.limits.model_dump(mode="json"),
            "zero_output": job.recipe.zero_output,
            **({} if job.recipe.tumbles else {"tumbles": False}),
        },
        call=_grade,
    ),
)
ORDER = ("capture", *(stage.name for stage in STAGES), "report")
BY_NAME = {stage.name: stage for stage in STAGES}
