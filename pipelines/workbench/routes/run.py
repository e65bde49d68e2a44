"""A run: its units, each with its result and figures."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.archive import Run
from pipelines.certificates.ledger import stated
from pipelines.certificates.measured import measurement_of
from pipelines.diagnosis.sentences import plain_verdict
from pipelines.diagnosis.sentences import verdict as sentence
from pipelines.report.numbers import with_uncertainty
from pipelines.report.reasons import grouped_reasons
from pipelines.rerun.diff import coverage_of, with_standard_error
from pipelines.stages.judge import verdict_of
from pipelines.tables.frames import rows_of
from pipelines.workbench.pages import Workbench, asked, page, run_table, saved_as, table_csv
from pipelines.workbench.routes.units import newest_question
from pipelines.workbench.state import MissingPage, RunPage, StationPage
from schemas.errors import TumblelineError, WrongUse

router = APIRouter()
SHOWN = (
    "residual_rms_ug", "verification_norm_ug", "bias_error_ug", "velocity_random_walk_ug_rtHz", "bias_instability_ug",
)  # fmt: skip
HEADS = ("fit residual, rms, µg", "verification error of |a|, µg", "error, rms, µg", "N, µg/√Hz", "B, µg")
"""Heads of the columns of these figures."""
MOST_OTHERS = 50


@router.get("/run")
def run(request: Request) -> Response:
    """Result and figures of every unit of a run."""
    bench, state, problems = asked(request, RunPage)
    stored = bench.archive.run(state.run)
    state = state.model_copy(update={"run": stored.id})
    tables, about = stored.tables(), stored.about
    grades = rows_of(run_table(bench, stored.id, "grades").sort_values("slot")) if "grades" in tables else []
    cells = _cells(bench, stored.id, tables)
    try:
        ledger = stated(stored, [str(row["unit"]) for row in grades])
        certificates = {unit: calibration.sentence() for unit, calibration in ledger.items()}
    except TumblelineError as problem:
        certificates = {}
        problems.append(str(problem))
    events = rows_of(run_table(bench, stored.id, "events")) if "events" in tables else []
    return page(
        request, "run.html", state, problems, run=stored, about=about, grades=grades, cells=cells, shown=SHOWN, tables=tables,
        certificates=certificates, events=events, judged=_judged(bench, stored.id, tables),
        groups=grouped_reasons(grades), outcomes=Counter(str(row["outcome"]) for row in grades),
        other=_other(bench, state, problems), station=StationPage(run=stored.id), heads=HEADS,
        others=[name for name, _ in bench.index.ask(newest_question(MOST_OTHERS)).rows if name != stored.id],
        live=stored.records is not None and "history" not in tables,
    )  # fmt: skip


def _cells(bench: Workbench, run: str, tables: Sequence[str]) -> dict[str, dict[str, float]]:
    cells: dict[str, dict[str, float]] = {}
    if "figures" in tables:
        figures = run_table(bench, run, "figures")
        for row in rows_of(figures[figures["figure"].isin(SHOWN)]):
            cells.setdefault(str(row["unit"]), {})[str(row["figure"])] = float(row["value"])
    return cells


def _other(bench: Workbench, state: RunPage, problems: list[str]) -> dict[str, Any] | None:
    """The run that stands beside: its id, figures, results and verdict."""
    if not state.beside:
        return None
    try:
        stored = bench.archive.run(state.beside)
    except TumblelineError as problem:
        problems.append(str(problem))
        return None
    this, tables = bench.archive.run(state.run), stored.tables()
    grades = rows_of(run_table(bench, stored.id, "grades")) if "grades" in tables else []
    return {
        "id": stored.id,
        "cells": _cells(bench, stored.id, tables),
        "outcomes": {str(row["unit"]): str(row["outcome"]) for row in grades},
        "judged": _judged(bench, stored.id, tables),
        "changes": _changes(bench, this, stored),
        "k": f"{coverage_of(this.about):g}",
    }


def _changes(bench: Workbench, this: Run, other: Run) -> dict[tuple[str, str], tuple[str, str]]:
    """By unit and figure, this run less the other: the difference and its U as texts.

    Of two measurements U is that of independent ones, with k of this run: what their station has in common makes it smaller. Two
    analyses of one measurement share its noise, and the difference has no U.
    """
    if not all("figures" in run.tables() for run in (this, other)):
        return {}
    figures, beside = (
        {(str(row["unit"]), str(row["figure"])): row for row in rows_of(with_standard_error(run.about, table))}
        for run, table in ((run, run_table(bench, run.id, "figures")) for run in (this, other))
    )
    apart, k = measurement_of(this) != measurement_of(other), coverage_of(this.about)
    found: dict[tuple[str, str], tuple[str, str]] = {}
    for key in figures.keys() & beside.keys():
        change = float(figures[key]["value"]) - float(beside[key]["value"])
        standard = [float(rows[key]["standard_error"]) for rows in (figures, beside)]
        if key[1] in SHOWN and math.isfinite(change):
            found[key] = with_uncertainty(change, k * math.hypot(*standard) if apart else 0.0)
    return found


def _judged(bench: Workbench, run: str, tables: Sequence[str]) -> tuple[bool | None, str]:
    """Whether the model is adequate, and the verdict as a sentence: of the archive, else of a diagnosis."""
    verdict = verdict_of(run_table(bench, run, "verdict")) if "verdict" in tables else None
    if verdict is not None:
        return verdict["adequate"], plain_verdict(verdict)
    diagnosed, _ = bench.work("diagnose", MissingPage(source=run), [])
    return (None, "") if diagnosed is None else (diagnosed.document["adequate"], sentence(diagnosed.document))


@router.get("/run/table/{name}.csv")
def table(request: Request, name: str) -> Response:
    """A table of a run."""
    bench, state, _ = asked(request, RunPage)
    return table_csv(rows_of(run_table(bench, state.run, name)), f"{state.run}-{name}")


@router.get("/run/report.html")
def report(request: Request) -> Response:
    """The report of a run, as a file."""
    bench, state, _ = asked(request, RunPage)
    stored = bench.archive.run(state.run)
    if not stored.report.is_file():
        raise WrongUse(f"run {stored.id} has no report; make it with 'tumbleline show {stored.id} --report'")
    return Response(stored.report.read_bytes(), media_type="text/html", headers=saved_as(f"{stored.id}.html"))
