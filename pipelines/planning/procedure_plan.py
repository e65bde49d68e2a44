"""What the procedures of a recipe take of a station's time, need of it and determine, before they are measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipelines.procedures import PROCEDURES, FigureSpec, parts_of
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import schedule, spent
from schemas.limits import Limit, Limits
from schemas.recipe import Recipe
from schemas.station import StationConfig


def plan_of_procedures(recipe: Recipe, station: StationConfig, limits: Limits | None) -> dict[str, Any]:
    """Document of a recipe without the multi-position test: its time and procedures; no effect of a sensor's model is fitted."""
    return {
        "recipe": recipe.name,
        "device": recipe.device,
        "station": station.name,
        "minutes": spent(schedule(steps(recipe), station, recipe)).document(),
        "procedures": procedure_rows(recipe, station, limits),
        "effects": [],
    }


def procedure_rows(recipe: Recipe, station: StationConfig, limits: Limits | None) -> list[dict[str, Any]]:
    """A row for each procedure of the recipe's list, in order: records, station time, equipment, figures with their limits."""
    activities = schedule(steps(recipe), station, recipe)
    asked = {} if limits is None else limits.figures
    rows: list[dict[str, Any]] = []
    for number, part in enumerate(parts_of(recipe)):
        procedure = PROCEDURES[part.kind]
        own = [activity for activity in activities if activity.step.procedure == number]
        rows.append(
            {
                "procedure": part.kind,
                "states": procedure.states,
                "records": len({activity.step.record for activity in own}),
                "minutes": round(spent(own).total, 2),
                "temperatures_C": list(dict.fromkeys(activity.step.temperature for activity in own)),
                "equipment": list(procedure.roles),
                "figures": [_figure(spec, asked) for spec in procedure.figures],
            }
        )
    return rows


def _figure(spec: FigureSpec, asked: Mapping[str, Limit]) -> dict[str, Any]:
    limit = asked.get(spec.name)
    return {
        "figure": spec.name,
        "unit": spec.unit,
        "meaning": spec.meaning,
        "limit": None if limit is None else limit.text,
    }
