"""Temperatures, angles and rates that a station is not able to reach or not allowed to; and what 'run' would refuse."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from schemas.errors import RecipeInvalid, TumblelineError
from schemas.recipe import Recipe
from schemas.station import StationConfig


def refuse_beyond_station(recipe: Recipe, station: StationConfig) -> None:
    """Refuse temperatures, °C, angles, degrees, and rates, Hz, outside of the limits of the station.

    Raises
    ------
    RecipeInvalid : names the key, the first value outside, and the range
    """
    limits = station.limits
    temperatures = [*recipe.temperatures_C, *([recipe.static_temperature_C] if recipe.static_record_s > 0.0 else [])]
    _refuse_outside("temperatures_C", temperatures, limits.temperature_C, f"°C, the chamber of station {station.name}")
    chosen = [*recipe.poses, *recipe.verification, recipe.static_pose]
    where = f"°, the table of station {station.name}"
    _refuse_outside("poses (outer)", [p.outer_deg for p in chosen], (limits.outer_deg[0], limits.outer_deg[1]), where)
    _refuse_outside("poses (inner)", [p.inner_deg for p in chosen], (limits.inner_deg[0], limits.inner_deg[1]), where)
    _refuse_outside("rate_hz", [recipe.rate_hz], (0.0, limits.rate_hz), f"Hz, the reader of station {station.name}")


def refused_by_run(recipe: Recipe, station: StationConfig, folder: Path) -> list[str]:
    """What 'tumbleline run' refuses in a recipe that can be planned: limits that cannot be read, ranges of the station.

    Parameters
    ----------
    folder : where a limits file that the recipe names is looked for
    """
    from pipelines.jobs.recipes import load_limits
    from pipelines.procedures import refuse_unusable

    messages: list[str] = []
    for check in (
        lambda: load_limits(recipe, folder),
        lambda: refuse_beyond_station(recipe, station),
        lambda: refuse_unusable(recipe, station),
    ):
        try:
            check()
        except TumblelineError as problem:
            messages.append(str(problem))
    return messages


def _refuse_outside(key: str, values: Sequence[float], bounds: tuple[float, float], what: str) -> None:
    low, high = bounds
    outside = [value for value in values if not low <= value <= high]
    if outside:
        unit, owner = what.split(", ", 1)
        raise RecipeInvalid(
            f"recipe: key '{key}': {outside[0]:g} {unit}, {owner} reaches {low:g} to {high:g} {unit}; change the recipe, "
            "or measure on another station",
            key=key.split(" ", 1)[0],
        )
