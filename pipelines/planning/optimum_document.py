"""The document of a recipe search: the recipe found beside the one that the search started from and the textbook plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from inertial.errors import NotIdentified
from inertial.planning.expected import Expected
from inertial.planning.visibility import visibilities
from pipelines.planning.context import PlanContext, plan_context
from pipelines.planning.discrimination import rival_separations
from pipelines.planning.optimise import Optimum
from pipelines.planning.plan import identified
from pipelines.schedule.timing import spent
from schemas.recipe import Recipe
from schemas.units import MICRO


@dataclass(frozen=True)
class OwnRecipe:
    """The recipe that the search starts from, for comparison.

    name : as given on the command line
    context : the recipe on the station
    expected : expected standard errors of its model; None where it cannot identify the model
    """

    name: str
    context: PlanContext
    expected: Expected | None


def own_recipe(base: Recipe, name: str, best: Optimum) -> OwnRecipe:
    """The recipe of the command line on the same station, with the same flicker model as the new recipe."""
    slowest = float(best.against.state.time[-1])
    context = plan_context(base, best.against.station, best.against.noise, slowest=slowest)
    try:
        expected = identified(context)
    except NotIdentified:
        expected = None
    return OwnRecipe(name, context, expected)


def optimum_document(best: Optimum, plan: dict[str, Any], own: OwnRecipe) -> dict[str, Any]:
    """The result of a search as a document for programs."""
    textbook = best.against
    seen = {s.effect for s in visibilities(textbook.state, textbook.recipe.effects, 1.0) if s.seen}
    reference = {
        (row["true"], row["wrong"]): row["chi_square"] for row in rival_separations(best.requirement, textbook)
    }
    rivals = [
        {**r, "textbook": reference[r["true"], r["wrong"]]} for r in rival_separations(best.requirement, best.planned)
    ]
    own_minutes = spent(own.context.activities).document()
    return {
        "recipe": plan["recipe"],
        "from": own.name,
        "dwell_s": plan["dwell_s"]["planned"],
        "temperatures_C": plan["temperatures_C"],
        "poses": plan["poses"],
        "dwells": plan["dwells"],
        "minutes": plan["minutes"],
        "own_minutes": own_minutes,
        "own_worst": _own_worst(best, own),
        "textbook_minutes": spent(textbook.activities).document(),
        "share": best.share,
        "verification_dwells": _verification(best.planned.recipe),
        "worst": best.worst,
        "coefficients": _coefficient_rows(best, plan, own),
        "rivals": rivals,
        "seen_besides": sorted({row["effect"] for row in plan["effects"] if row["seen"]} - seen),
        "plan": plan,
    }


def _own_worst(best: Optimum, own: OwnRecipe) -> float | None:
    """Largest ratio of the own recipe's errors to the required ones; None for rivals, or where it has no errors."""
    if own.expected is None or best.requirement.discrimination is not None:
        return None
    return float((own.expected.errors / best.requirement.errors).max())


def _coefficient_rows(best: Optimum, plan: dict[str, Any], own: OwnRecipe) -> list[dict[str, Any]]:
    """Coefficients with the required error (None where rivals are discriminated) and the own recipe's error."""
    axis_number = {"x": 0, "y": 1, "z": 2}
    columns: dict[str, int] = {}
    rows: list[dict[str, Any]] = []
    for row in plan["coefficients"]:
        if row["axis"] in axis_number:
            axis, column = axis_number[row["axis"]], columns.setdefault(row["axis"], 0)
            columns[row["axis"]] += 1
            required = (
                MICRO * float(best.requirement.errors[axis, column]) if not best.requirement.discrimination else None
            )
            own_error = None if own.expected is None else MICRO * float(own.expected.errors[axis, column])
            rows.append({**row, "wanted_ug": required, "own_ug": own_error})
    return rows


def _verification(recipe: Recipe) -> int:
    """Number of verification dwells of a recipe."""
    return sum(len(recipe.verification_at(k)) for k in range(len(recipe.temperatures_C)))
