"""The plan of a recipe: poses, temperatures, visible effects, hidden effects, and station time; poses can be moved."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response

from inertial import effects
from inertial.frames import angles_from_force
from pipelines.archive import files
from pipelines.drawing.mollweide import direction_at
from pipelines.jobs.moved_poses import moves_of
from pipelines.jobs.recipe_text import limits_from, recipe_text
from pipelines.jobs.recipes import folder_of, sample_names
from pipelines.report.numbers import scientific
from pipelines.workbench.pages import RequestBody, asked, figure, no_figure, page, state_at, table_csv, workbench_of
from pipelines.workbench.services import requests
from pipelines.workbench.services.work import recipe_of
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import PlanPage
from schemas.errors import WrongUse
from schemas.foreign import shown
from schemas.recipe import Recipe

NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,60}")
STEP_DEG = 0.5
"""Grid of the angles of a pose that is dragged: a hand aims no better on a map of 400 pixels."""


def dragged_to(settings: WorkbenchSettings, state: PlanPage, name: str, x: float, y: float) -> PlanPage:
    """The page with a pose at a point of the map; of the two ways to turn there, that nearer to the pose's present angles.

    Raises
    ------
    WrongUse
        The point is outside of the sphere.
    """
    force = direction_at(x, y)
    if force is None:
        raise WrongUse(f"plan: pose {shown(name, 40)} was dropped outside of the sphere; drop it inside the outline")
    outer, inner = (float(value) for value in np.degrees(angles_from_force(force)))
    recipe = _recipe(settings, state)
    present = next((p for p in (*recipe.poses, *recipe.verification) if p.name == name), None)
    other = (-outer, inner - 180.0 if inner > 0.0 else inner + 180.0)
    ways = [(outer, inner), other]
    if present is not None:
        ways.sort(key=lambda way: abs(way[0] - present.outer_deg) + abs(way[1] - present.inner_deg))
    return turned_to(settings, state, name, *(STEP_DEG * round(angle / STEP_DEG) for angle in ways[0]))


def turned_to(settings: WorkbenchSettings, state: PlanPage, name: str, outer: float, inner: float) -> PlanPage:
    """The page with a pose at these angles, degrees; checked as a recipe is.

    Raises
    ------
    TumblelineError
        There is no such pose, or the recipe cannot work with it there.
    """
    others = tuple(text for text in state.pose if next(iter(moves_of([text], "plan"))) != name)
    new = state.model_copy(update={"pose": (*others, f"{name}={outer:g},{inner:g}"), "edit": name})
    _recipe(settings, new)
    return new


def save_recipe(settings: WorkbenchSettings, state: PlanPage, name: str) -> Path:
    """The file of the recipe with its moved poses; an existing file is not replaced.

    Raises
    ------
    WrongUse
        The name is unusable or taken, or the model has formulas, which a recipe file cannot hold.
    """
    if not NAME.fullmatch(name) or name in sample_names():
        raise WrongUse(
            f"recipe: name '{shown(name, 60)}', lower-case letters, digits, ., - and _ are needed, and no built-in name; "
            "write one such as my-line"
        )
    path = settings.folder / f"{name}.toml"
    if path.exists():
        raise WrongUse(f"recipe: {path} exists already; choose another name")
    recipe = _recipe(settings, state)
    limits = limits_from(recipe.limits, folder_of(state.recipe), settings.folder)
    moved = ", ".join(state.pose) or "no pose is moved"
    new = recipe.model_copy(update={"name": name, "limits": limits})
    text = recipe_text(new, [f"Recipe {state.recipe} with poses moved by hand (outer, inner in degrees): {moved}."])
    settings.folder.mkdir(parents=True, exist_ok=True)
    files.publish(path, text.encode(), "recipe", files.ELSEWHERE)
    return path


def _recipe(settings: WorkbenchSettings, state: PlanPage) -> Recipe:
    """The recipe of a page; formulas of its model are known during the call only."""
    with effects.additions_forgotten():
        return recipe_of(requests.plan(settings, state)[1])[1]


router = APIRouter()
HEADING, ORDER, ADDRESS = "Plan", 50, "/plan"


@router.get("/plan")
def plan(request: Request) -> Response:
    """The page."""
    bench, state, problems = asked(request, PlanPage)
    planned, job = bench.work("plan", state, problems)
    poses = [] if planned is None else planned["poses"]
    rows = [] if planned is None else sorted(planned["document"]["effects"], key=lambda row: row["left"])
    chosen = next((pose for pose in poses if pose["name"] == state.edit), next(iter(poses), None))
    return page(
        request, "plan.html", state, problems, planned=planned, job=job, recipes=requests.recipes(bench.settings),
        scientific=scientific, listed=[row for row in rows if _is_listed(row, state)], chosen=chosen,
    )  # fmt: skip


def _is_listed(row: Mapping[str, Any], state: PlanPage) -> bool:
    text = " ".join(str(row.get(key) or "") for key in ("effect", "why", "breaker", "alias")).lower()
    return state.search.lower() in text and not (state.only and row["seen"])


@router.get("/plan/figure/{name}.{ending}")
def drawn(request: Request, name: str, ending: str) -> Response:
    """A figure of the page."""
    bench, state, _ = asked(request, PlanPage)
    planned = bench.done("plan", state)
    if planned is None or name not in planned["charts"]:
        raise no_figure(name)
    return figure(planned["charts"][name], ending, f"plan-{name}")


@router.get("/plan/effects.csv")
def visibility(request: Request) -> Response:
    """Visibility of each effect under the plan."""
    bench, state, _ = asked(request, PlanPage)
    planned = bench.done("plan", state)
    keys = ("effect", "seen", "left", "floor_ug", "floor_unit", "floor_size_ug", "breaker")
    rows = [] if planned is None else [{key: row.get(key) for key in keys} for row in planned["document"]["effects"]]
    return table_csv(rows, "plan-effects")


@router.post("/plan/pose")
def move(request: Request, body: RequestBody) -> JSONResponse:
    """The address of the page with a pose at other angles, or dropped at a point of the map."""
    bench, state = workbench_of(request), state_at(body, PlanPage)
    name = str(body.get("name", ""))
    if "x" in body:
        x, y = _numbers(body, "x", "y")
        new = dragged_to(bench.settings, state, name, x, y)
    else:
        outer, inner = _numbers(body, "outer", "inner")
        new = turned_to(bench.settings, state, name, outer, inner)
    return JSONResponse({"address": new.address()})


@router.post("/plan/save")
def save(request: Request, body: RequestBody) -> JSONResponse:
    """Write the recipe with its moved poses as a new file."""
    bench, state = workbench_of(request), state_at(body, PlanPage)
    path = save_recipe(bench.settings, state, str(body.get("name", "")).strip())
    return JSONResponse({"done": f"{path} is written", "shown": PlanPage(recipe=str(path)).address()})


def _numbers(body: dict[str, object], *names: str) -> list[float]:
    numbers: list[float] = []
    for name in names:
        text = str(body.get(name, ""))
        try:
            numbers.append(float(text))
        except ValueError:
            raise WrongUse(f"plan: {name} '{text[:20]}', a number is needed; write the angle in degrees") from None
    return numbers
