"""The plan of a recipe: poses, temperatures, visible effects, hidden effects, and station time."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import Response

from pipelines.report.numbers import scientific
from pipelines.workbench.pages import figure, page, state_of, table_csv, workbench_of
from pipelines.workbench.services import requests
from pipelines.workbench.state import PlanPage
from schemas.errors import TumblelineError, WrongUse

router = APIRouter()
HEADING, ORDER, ADDRESS = "Plan", 50, "/plan"


@router.get("/plan")
def plan(request: Request) -> Response:
    """The page."""
    bench = workbench_of(request)
    state, problems = state_of(request, PlanPage)
    found, job = None, None
    try:
        _, content = requests.plan(bench.settings, state)
        found, job = bench.jobs.result("plan", content), bench.jobs.known("plan", content)
    except TumblelineError as problem:
        problems = [*problems, str(problem)]
    return page(
        request,
        "plan.html",
        state,
        problems,
        found=found,
        job=job,
        recipes=requests.recipes(bench.settings),
        scientific=scientific,
    )


@router.get("/plan/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench = workbench_of(request)
    state, _ = state_of(request, PlanPage)
    found = bench.jobs.result("plan", requests.plan(bench.settings, state)[1])
    if found is None or name not in found["charts"]:
        raise WrongUse(f"figure: none of this page is called '{name[:40]}'")
    return figure(found["charts"][name], ending, f"plan-{name}")


@router.get("/plan/effects.csv")
def effects(request: Request) -> Response:
    """Visibility of each effect under the plan."""
    bench = workbench_of(request)
    state, _ = state_of(request, PlanPage)
    found = bench.jobs.result("plan", requests.plan(bench.settings, state)[1])
    keys = ("effect", "seen", "left", "floor_ug", "floor_unit", "floor_size_ug", "breaker")
    rows = [] if found is None else [{key: row.get(key) for key in keys} for row in found["document"]["effects"]]
    return table_csv(rows, "plan-effects")
