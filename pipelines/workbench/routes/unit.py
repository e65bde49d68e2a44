"""A unit of a run: model and measurement, coefficients, noise, history, certificates."""

from collections.abc import Mapping
from typing import Any

import pandas as pd
from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.audit.calibrations import day_of
from pipelines.certificates import Ledger
from pipelines.drawing import Chart
from pipelines.report import run_pictures
from pipelines.report.numbers import axis_word, side_by_side, with_uncertainty
from pipelines.report.unit_panels.budget import NAMES
from pipelines.report.unit_panels.noise import NAMES as NOISE_TERMS
from pipelines.rerun.diff import coverage_of
from pipelines.stages.figures import figure_label
from pipelines.stages.judge import verdict_of
from pipelines.tables.frames import rows_of
from pipelines.workbench.pages import (
    Workbench,
    asked,
    figure,
    no_figure,
    not_known,
    page,
    page_part,
    part_of,
    run_table,
    samples_of,
    table_csv,
)
from pipelines.workbench.state import UnitPage, quoted
from schemas.decisions import digits_beside
from schemas.errors import WrongUse

router = APIRouter()
CERTIFICATES = 20
COVERAGE = 2.0
"""Coverage factor of the coefficients."""


@router.get("/unit")
def unit(request: Request) -> Response:
    """All data of a unit in a run."""
    bench, state, problems = asked(request, UnitPage)
    run = bench.archive.run(state.run)
    units = [str(seat["serial"]) for seat in run.about.get("lot", {}).get("units", [])]
    state = state.model_copy(update={"run": run.id, "unit": state.unit or (units[0] if units else "")})
    if state.unit not in units:
        raise WrongUse(f"unit '{state.unit[:80]}' is not in run {run.id}; its units are {', '.join(units[:8])}")
    if part_of(request) == "samples":
        return page_part(request, "unit_samples.html", state)
    tables = run.tables()
    rows = {
        name: rows_of(_table(bench, state, name))
        for name in ("grades", "figures", "coefficients", "noise", "verdicts", "uncertainties")
        if name in tables
    }
    grade = next(iter(rows.get("grades", [])), None)
    history = _history(bench, state.unit)
    fitted = "residuals" in tables and (grade is None or grade["outcome"] != "refused")
    parameters = list(dict.fromkeys(_parameter(row) for row in history))
    if parameters and state.parameter not in parameters:
        state = state.model_copy(update={"parameter": parameters[0]})
    both = [_table(bench, state, name) for name in ("residuals", "dwells")] if fitted else []
    drivers = run_pictures.quantities(*both) if both else {}
    if both and (ignored := not_known(state, against=drivers)):
        problems, state = [*problems, *ignored], state.model_copy(update={"against": ""})
    state = state.model_copy(update={"against": _against(bench, state) if fitted else ""})
    index = units.index(state.unit)
    return page(
        request, "unit.html", state, problems, run=run, grade=grade, rows=rows, tables=tables, units=units,
        drivers=drivers,
        before=units[index - 1] if index else "", after=units[index + 1] if index + 1 < len(units) else "",
        coefficients=side_by_side(rows.get("coefficients", []), _expanded), parameters=parameters,
        coverage=coverage_of(run.about),
        names=NAMES, noise_terms=NOISE_TERMS, axis_word=axis_word, figure_label=figure_label, digits_beside=digits_beside,
        certificates=Ledger(bench.archive).calibrations(state.unit)[-CERTIFICATES:][::-1],
    )  # fmt: skip


@router.get("/unit/budget.csv")
def budget(request: Request) -> Response:
    """The contributions to the uncertainty of every coefficient of a unit."""
    bench, state, _ = asked(request, UnitPage)
    return table_csv(rows_of(_table(bench, state, "budget")), f"{state.unit}-budget")


@router.get("/unit/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench, state, _ = asked(request, UnitPage)
    return figure(_chart(bench, state, name), ending, f"{state.unit}-{name}")


def _chart(bench: Workbench, state: UnitPage, name: str) -> Chart:
    if name == "samples":
        samples, out_unit, title = samples_of(bench, state.run, state.dwell)
        return run_pictures.samples_chart(samples, title, out_unit)
    if name == "history":
        rows = [row for row in _history(bench, state.unit) if _parameter(row) == state.parameter]
        if not rows:
            raise WrongUse(
                f"figure: unit '{state.unit[:80]}' has no calibrations with '{state.parameter[:80]}', one at least is needed; "
                "choose a coefficient on its page"
            )
        return run_pictures.history_chart(rows, state.parameter, str(rows[0]["unit_text"]))
    if name == "allan":
        return Chart("Allan deviation", (run_pictures.allan_plot(_drawn(bench, state, "allan")),), height=340)
    if name == "residuals":
        residuals, dwells = _drawn(bench, state, "residuals"), _drawn(bench, state, "dwells")
        return run_pictures.residual_chart(state.unit, residuals, dwells, _against(bench, state))
    raise no_figure(name)


def _against(bench: Workbench, state: UnitPage) -> str:
    """The quantity against which residuals are drawn: that of the address, else that on which they depend most."""
    if state.against:
        return state.against
    tables = bench.archive.run(state.run).tables()
    verdict = verdict_of(run_table(bench, state.run, "verdict")) if "verdict" in tables else None
    if verdict is not None and verdict["adequate"]:
        return "force"
    return run_pictures.follows_most(_table(bench, state, "residuals"), _table(bench, state, "dwells"))


def _table(bench: Workbench, state: UnitPage, name: str) -> pd.DataFrame:
    table = run_table(bench, state.run, name)
    return table[table["unit"] == state.unit]


def _drawn(bench: Workbench, state: UnitPage, name: str) -> pd.DataFrame:
    rows = _table(bench, state, name) if name in bench.archive.run(state.run).tables() else None
    if rows is None or rows.empty:
        raise WrongUse(
            f"figure: unit '{state.unit[:80]}' has no {name} in run {state.run[:80]}, some are needed; choose another unit or run"
        )
    return rows


def _history(bench: Workbench, serial: str) -> list[dict[str, Any]]:
    """The unit's coefficients in all its runs, with the day of each."""
    rows = bench.index.of_unit(serial, history_question(serial)).documents()
    return [{**row, "day": day_of(str(row["measured"]))} for row in rows if row["measured"]]


def history_question(unit: str) -> str:
    """The coefficients of a unit in all its runs, in SQL."""
    return (
        "SELECT measured, run, effect, name, axis, value, standard_error, unit_text "  # noqa: S608 - the serial is quoted
        "FROM coefficients JOIN runs USING (run) "
        f"WHERE unit = {quoted(unit)} AND rerun_of = '' ORDER BY measured, run"
    )


def _parameter(row: dict[str, Any]) -> str:
    return f"{row['effect']} {row['name']} {row['axis']}"


def _expanded(row: Mapping[str, Any]) -> tuple[str, str]:
    """Value and expanded uncertainty of a coefficient as texts."""
    return with_uncertainty(float(row["value"]), COVERAGE * float(row["standard_error"]))
