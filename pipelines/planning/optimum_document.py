"""The document of a recipe search: the recipe found beside that from which the search started and the textbook plan."""

from collections import Counter
from typing import Any

from inertial.arrays import Array
from inertial.errors import NotIdentified
from inertial.planning.visibility import visibilities
from pipelines.planning.context import plan_context
from pipelines.planning.discrimination import rival_separations
from pipelines.planning.lower_bound import lower_bound
from pipelines.planning.optimise import Optimum
from pipelines.planning.plan import identified, plan
from pipelines.schedule.timing import spent
from schemas.recipe import Recipe
from schemas.units import AXES, MICRO


def optimum_document(best: Optimum, base: Recipe, name: str) -> dict[str, Any]:
    """The result of a search as a document for programs.

    base : the recipe that the search started from; ``name`` : as given on the command line
    """
    document, by_errors = plan(best.planned), best.requirement.discrimination is None
    lower = lower_bound(base, best.against, best.requirement, ramp=True) if best.ramp and by_errors else None
    slowest = float(best.against.state.time[-1])  # the flicker model of the new recipe
    start = plan_context(base, best.against.station, best.against.noise, slowest=slowest, prior=best.requirement.prior)
    try:
        own_errors = identified(start).errors
    except NotIdentified:
        own_errors = None
    textbook, recipe = best.against, best.planned.recipe
    seen = {s.effect for s in visibilities(textbook.state, textbook.recipe.effects, 1.0) if s.seen}
    reference = {
        (row["true"], row["wrong"]): row["chi_square"] for row in rival_separations(best.requirement, textbook)
    }
    rivals = [
        {**r, "textbook": reference[r["true"], r["wrong"]]} for r in rival_separations(best.requirement, best.planned)
    ]
    return {
        "recipe": document["recipe"],
        "from": name,
        "dwell_s": document["dwell_s"]["planned"],
        "temperatures_C": document["temperatures_C"],
        "poses": document["poses"],
        "dwells": document["dwells"],
        "minutes": document["minutes"],
        "own_minutes": spent(start.activities).document(),
        # largest ratio of the own recipe's errors to the required ones; None for rivals, or where it cannot identify its model
        "own_worst": float((own_errors / best.requirement.errors).max())
        if by_errors and own_errors is not None
        else None,
        "textbook_minutes": spent(textbook.activities).document(),
        "share": best.share,
        "ramp": best.ramp,
        # least share of the textbook plan's station time on ramps, and what determines it; None for soaks and discrimination
        "bound": None if lower is None else {"share": lower.share, "effect": lower.effect},
        "verification_dwells": sum(len(recipe.verification_at(k)) for k in range(len(recipe.temperatures_C))),
        "worst": best.worst,
        "coefficients": _coefficient_rows(best, document["coefficients"], own_errors),
        "rivals": rivals,
        "seen_besides": sorted({row["effect"] for row in document["effects"] if row["seen"]} - seen),
        "plan": document,
    }


def _coefficient_rows(
    best: Optimum, coefficients: list[dict[str, Any]], own_errors: Array | None
) -> list[dict[str, Any]]:
    """Coefficients with the required error (None where rivals are discriminated) and the own recipe's error."""
    required = None if best.requirement.discrimination else best.requirement.errors
    column = Counter[str]()
    rows: list[dict[str, Any]] = []
    for row in coefficients:
        if row["axis"] in AXES:
            at = AXES.index(row["axis"]), column[row["axis"]]
            column[row["axis"]] += 1
            errors = {"wanted_ug": required, "own_ug": own_errors}
            rows.append({**row, **{key: None if e is None else MICRO * float(e[at]) for key, e in errors.items()}})
    return rows
