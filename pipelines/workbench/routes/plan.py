"""The plan of a recipe: poses, temperatures, visible effects, hidden effects, and station time; poses can be moved."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response

from pipelines.report.numbers import scientific
from pipelines.workbench.pages import RequestBody, figure, page, state_at, state_of, table_csv, workbench_of
from pipelines.workbench.services import recipes, requests
from pipelines.workbench.state import PlanPage
from schemas.errors import TumblelineError, WrongUse

router = APIRouter()
HEADING, ORDER, ADDRESS = "Plan", 50, "/plan"


@router.get("/plan")
def plan(request: Request) -> Response:
    """The page."""
    bench = workbench_of(request)
    state, problems = state_of(request, PlanPage)
    planned, job = None, None
    try:
        _, content = requests.plan(bench.settings, state)
        planned, job = bench.jobs.result("plan", content), bench.jobs.known("plan", content)
    except TumblelineError as problem:
        problems = [*problems, str(problem)]
    poses = [] if planned is None else planned["poses"]
    return page(
        request, "plan.html", state, problems, planned=planned, job=job, recipes=requests.recipes(bench.settings),
        scientific=scientific, chosen=next((one for one in poses if one["name"] == state.edit), next(iter(poses), None)),
    )  # fmt: skip


@router.get("/plan/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench = workbench_of(request)
    state, _ = state_of(request, PlanPage)
    planned = bench.jobs.result("plan", requests.plan(bench.settings, state)[1])
    if planned is None or name not in planned["charts"]:
        raise WrongUse(f"figure: none of this page is called '{name[:40]}'")
    return figure(planned["charts"][name], ending, f"plan-{name}")


@router.get("/plan/effects.csv")
def effects(request: Request) -> Response:
    """Visibility of each effect under the plan."""
    bench = workbench_of(request)
    state, _ = state_of(request, PlanPage)
    planned = bench.jobs.result("plan", requests.plan(bench.settings, state)[1])
    keys = ("effect", "seen", "left", "floor_ug", "floor_unit", "floor_size_ug", "breaker")
    rows = [] if planned is None else [{key: row.get(key) for key in keys} for row in planned["document"]["effects"]]
    return table_csv(rows, "plan-effects")


@router.post("/plan/pose")
def move(request: Request, body: RequestBody) -> JSONResponse:
    """The address of the page with a pose at other angles, or dropped at a place of the map."""
    bench, state = workbench_of(request), state_at(body, PlanPage)
    name = str(body.get("name", ""))
    if "x" in body:
        x, y = _numbers(body, "x", "y")
        new = recipes.dragged_to(bench.settings, state, name, x, y)
    else:
        outer, inner = _numbers(body, "outer", "inner")
        new = recipes.turned_to(bench.settings, state, name, outer, inner)
    return JSONResponse({"address": new.address()})


@router.post("/plan/save")
def save(request: Request, body: RequestBody) -> JSONResponse:
    """Write the recipe with its moved poses as a new file."""
    bench, state = workbench_of(request), state_at(body, PlanPage)
    place = recipes.save(bench.settings, state, str(body.get("name", "")).strip())
    return JSONResponse({"done": f"{place} is written", "shown": PlanPage(recipe=str(place)).address()})


def _numbers(body: dict[str, object], *names: str) -> list[float]:
    numbers: list[float] = []
    for name in names:
        try:
            numbers.append(float(str(body.get(name, ""))))
        except ValueError:
            raise WrongUse(
                f"plan: {name} '{str(body.get(name, ''))[:20]}', a number is needed; write the angle in degrees"
            ) from None
    return numbers
