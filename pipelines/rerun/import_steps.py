"""The stages of an import that its references and held-out dwells allow: verification by the norm, and the budget."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from pipelines.archive import Run, code_hash
from pipelines.chain.chain import BY_NAME, Tables
from pipelines.importers.plane import plane_answer
from pipelines.stages.judge import judge
from pipelines.stages.uncertainty.budget import budget
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.unknown_poses.budget import norm_budget
from pipelines.stages.unknown_poses.fit import fitted_dwells
from pipelines.stages.unknown_poses.verify import verify_norms
from pipelines.tables.frames import empty_table


@dataclass(frozen=True)
class StageCall:
    """One stage for one run: as :class:`pipelines.chain.chain.Stage`, with everything that the job decides filled in."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: dict[str, Any]
    code: str
    call: Callable[[Run], Tables]


def recorded_history(run: Run) -> pd.DataFrame:
    """The temperatures between the dwells of a run; without rows where it has none."""
    return run.table("history") if "history" in run.tables() else empty_table(texts="unit", numbers="time_s unit_C")


def no_noise() -> pd.DataFrame:
    """The table of noise terms of an import, which has no static record."""
    return empty_table(texts="unit axis term unit_text", numbers="value low high", flags="identified")


def verify_norms_step(gravity: float, *, history: bool) -> StageCall:
    """Verification of a fit by the norm of gravity, g, on the dwells that were held out; no row where none was."""
    stage = BY_NAME["verify"]
    names = ("dwells", "coefficients", "covariance", "wander")

    def call(run: Run) -> Tables:
        dwells, coefficients, covariance, wander = (run.table(name) for name in names)
        return verify_norms(
            dwells, run.table("history") if history else None, coefficients, covariance, wander, gravity
        )

    code = code_hash("verify of norms")
    inputs = (*names, "history") if history else names
    return StageCall("verify", inputs, stage.outputs, {"gravity_g": gravity}, code, call)


def judge_step(model: dict[str, Any], *, history: bool, known: bool) -> StageCall:
    """The verdict on the model of an import; of dwells of unknown poses those that are held out are not judged."""
    stage = BY_NAME["judge"]

    def call(run: Run) -> Tables:
        dwells = run.table("dwells")
        past = run.table("history") if history else None
        return judge(dwells if known else fitted_dwells(dwells), past, model["effects"])

    inputs = ("dwells", "history") if history else ("dwells",)
    parameters = {"effects": model["effects"], "formulas": model["formulas"], "known_poses": known}
    return StageCall("judge", inputs, stage.outputs, parameters, code_hash(stage.name), call)


def plane_step(across: int, gravity: float) -> StageCall:
    """The fit of the two axes in the plane across an axis; gravity, g, is read where the poses are not known."""

    def call(run: Run) -> Tables:
        dwells = run.table("dwells")
        answer = plane_answer(dwells, across, gravity, str(dwells["out_unit"].iloc[0]))
        return {"coefficients": pd.DataFrame(answer.coefficients)}

    code = code_hash("fit in a plane")
    return StageCall("fit", ("dwells",), ("coefficients",), {"plane_across": across, "gravity_g": gravity}, code, call)


def budget_step(terms: BudgetTerms, *, history: bool, known: bool) -> StageCall:
    """The uncertainty budget of an import whose references are stated.

    Parameters
    ----------
    known : whether its poses are known; otherwise only the norm of gravity is
    """
    stage = BY_NAME["budget"]
    names = ("coefficients", "covariance", "wander", "verification", "verification_poses")

    def call(run: Run) -> Tables:
        tables = {name: run.table(name) for name in names}
        whole = BudgetTables(
            dwells=run.table("dwells"),
            history=recorded_history(run),
            noise=no_noise(),
            lot=None,
            calibration=None,
            **tables,
        )
        return budget(whole, terms) if known else norm_budget(whole, terms)

    code = code_hash("budget" if known else "budget of norms")
    inputs = ("dwells", *(("history",) if history else ()), *names)
    return StageCall("budget", inputs, stage.outputs, terms.document(), code, call)
