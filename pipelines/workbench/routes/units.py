"""Search of units and runs."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.audit.sql import ask
from pipelines.workbench.pages import page, state_of, table_csv, workbench_of
from pipelines.workbench.questions import ROWS, units_question, yield_question
from pipelines.workbench.state import UnitsPage

router = APIRouter()
HEADING, ORDER, ADDRESS = "Units", 10, "/units"
EVERYTHING = 1_000_000


@router.get("/units")
def units(request: Request) -> Response:
    """A page of units, newest first."""
    bench = workbench_of(request)
    state, problems = state_of(request, UnitsPage)
    infos = bench.archive.runs()
    rows, counts = [], {}
    if infos:
        answer = ask(bench.archive, units_question(state))
        rows = [dict(zip(answer.columns, row, strict=True)) for row in answer.rows]
        counts = {str(name): int(count) for name, count in ask(bench.archive, yield_question(state)).rows}
    return page(
        request, "units.html", state, problems, rows=rows, counts=counts, total=sum(counts.values()), per_page=ROWS,
        runs=infos[::-1][:12], run_count=len(infos),
    )  # fmt: skip


@router.get("/units/table.csv")
def table(request: Request) -> Response:
    """All units of the search."""
    state, _ = state_of(request, UnitsPage)
    question = units_question(state.model_copy(update={"page": 1})).replace(f"LIMIT {ROWS}", f"LIMIT {EVERYTHING}")
    answer = ask(workbench_of(request).archive, question)
    return table_csv([dict(zip(answer.columns, row, strict=True)) for row in answer.rows], "units")
