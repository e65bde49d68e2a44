"""The plan of a recipe for its page: the document of ``tumbleline plan`` and its charts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from schemas.recipe import Recipe
from schemas.station import StationConfig


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
    from pipelines.planning.context import plan_context
    from pipelines.planning.plan import plan
    from pipelines.planning.preset_noise import noise_of
    from pipelines.report.plan_pictures import sphere_chart, temperature_chart

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
