"""The plan of a recipe for its page: the document of ``tumbleline plan`` and its charts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from inertial.frames import force_from_angles
from pipelines.report.charts import Chart, Plot, PlotAxis, Trace
from pipelines.report.charts.mollweide import project, sphere
from pipelines.schedule.timing import temperatures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pipelines.planning.plan import PlanContext
    from pipelines.report.charts.chart import Role
    from schemas.recipe import Recipe
    from schemas.station import StationConfig

KINDS = (
    ("dwell", "fit", "accent", "circle"),
    ("verification", "verification", "before", "square"),
    ("allan", "static record", "z", "diamond"),
)


def recipe_of(request: Mapping[str, Any]) -> tuple[Recipe, Recipe, StationConfig]:
    """The recipe of a request as it stands, the same with its moved poses, and the station.

    Raises
    ------
    TumblelineError
        The recipe, its model or a pose is invalid.
    """
    from pathlib import Path

    from pipelines.archive import Archive
    from pipelines.jobs.model_files import chosen_effects, use_formulas
    from pipelines.jobs.moved_poses import moves_of, with_moved_poses
    from pipelines.jobs.recipes import load_recipe
    from pipelines.jobs.releases import line_model
    from schemas.station import load_station

    config = load_station(Path(request["station"]) if request["station"] else None)
    chosen = chosen_effects(",".join(request["effects"]), None, "plan")

    def line(device: str) -> dict[str, Any]:
        if chosen:
            return {"effects": chosen}
        keys = line_model(Archive(request["archive"]), device, config.name)
        use_formulas(keys["formulas"], "the line's model")
        return keys

    recipe = load_recipe(request["recipe"], line)
    recipe = recipe.model_copy(update={"effects": list(chosen)}) if chosen else recipe
    return recipe, with_moved_poses(recipe, moves_of(request["pose"], "plan"), "plan"), config


def planned(request: Mapping[str, Any]) -> dict[str, Any]:
    """``document``, ``charts`` and ``poses`` of a plan; ``before``: the effects of the recipe by name, where poses are moved."""
    from pipelines.planning.plan import plan, plan_context
    from pipelines.planning.preset_noise import noise_of

    as_it_stands, recipe, config = recipe_of(request)
    noise = noise_of(recipe, recipe.device, None, None)
    context = plan_context(recipe, config, noise)
    before = plan(plan_context(as_it_stands, config, noise)) if request["pose"] else None
    return {
        "document": plan(context),
        "before": None if before is None else {row["effect"]: row for row in before["effects"]},
        "minutes_before": None if before is None else before["minutes"]["total"],
        "charts": {"sphere": sphere_chart(context), "temperature": temperature_chart(context)},
        "poses": pose_rows(as_it_stands, recipe),
    }


def pose_rows(as_it_stands: Recipe, recipe: Recipe) -> list[dict[str, Any]]:
    """Every pose once: name, use, angles in degrees, and whether it was moved."""
    rows: dict[str, dict[str, Any]] = {}
    for use in ("poses", "verification"):
        for old, new in zip(getattr(as_it_stands, use), getattr(recipe, use), strict=True):
            rows[new.name] = {
                "name": new.name,
                "use": "fit" if use == "poses" else "verification",
                "outer_deg": new.outer_deg,
                "inner_deg": new.inner_deg,
                "moved": (old.outer_deg, old.inner_deg) != (new.outer_deg, new.inner_deg),
            }
    return list(rows.values())


def sphere_chart(context: PlanContext) -> Chart:
    """Directions of specific force in the fixture for every pose, with the order in the first soak."""
    traces: list[Trace] = []
    first = [a for a in context.activities if a.kind == "dwell" and a.step.soak == context.activities[0].step.soak]
    for kind, label, role, symbol in KINDS[:2]:
        own = [a.step.pose for a in context.activities if a.kind == kind]
        if own:
            named = {(pose.outer_deg, pose.inner_deg): pose.name for pose in own}
            outer, inner = np.radians(np.array(list(named))).T
            x, y = project(force_from_angles(outer, inner))
            texts = tuple(f"{name}: outer {o:g}°, inner {i:g}°" for (o, i), name in named.items())
            style = cast("Role", role), cast("Any", symbol)
            picks = tuple(named.values())
            traces.append(Trace(label, x, y, role=style[0], symbol=style[1], size=11, texts=texts, picks=picks))
    if len(first) > 1:
        outer, inner = np.radians(np.array([(a.step.pose.outer_deg, a.step.pose.inner_deg) for a in first])).T
        x, y = project(force_from_angles(outer, inner))
        numbers = tuple(str(k + 1) for k in range(len(first)))
        traces.append(Trace("order in the first soak", x, y - 0.085, "labels", "ink", texts=numbers, legend=False))
    return Chart(
        "Poses of the plan: where specific force points in the fixture", (sphere("", tuple(traces)),), height=420
    )


def temperature_chart(context: PlanContext) -> Chart:
    """Chamber and slowest device over the station's time, with the times of the measurements."""
    time, air, device = np.array(temperatures(context.activities, context.station)).T
    hours = time / 3600.0
    low = float(min(air.min(), device.min()))
    span = float(max(air.max(), device.max())) - low or 1.0
    traces = [Trace("chamber", hours, air, "line", "muted"), Trace("slowest device", hours, device, "line", "ink")]
    for row, (kind, label, role, symbol) in enumerate(KINDS):
        own = [a for a in context.activities if a.kind == kind]
        if own:
            x = np.array([a.start + 0.5 * a.seconds for a in own]) / 3600.0
            y = np.full(x.shape, low - (0.08 + 0.06 * row) * span)
            texts = tuple(f"{label}: {a.step.pose.name}" for a in own)
            traces.append(Trace(label, x, y, role=cast("Role", role), symbol=cast("Any", symbol), size=5, texts=texts))
    plot = Plot("", PlotAxis("station time / h"), PlotAxis("temperature / °C"), tuple(traces))
    return Chart("Temperatures and records over the station's time", (plot,), height=340)
