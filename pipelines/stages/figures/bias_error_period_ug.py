"""95 % bound of the largest axis' RMS error in a use at the end of the period: run, references, walk, switch-on, ageing."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, UnitTables, Value
from schemas.decisions import BOUND, LARGEST_ERROR, MEDIAN
from schemas.recipe import Recipe


def _value(tables: UnitTables) -> Value | None:
    if (LARGEST_ERROR, BOUND) not in tables.budget:
        return None
    bound, median = (tables.budget[LARGEST_ERROR, name].value for name in (BOUND, MEDIAN))
    return Value(bound, 0.0, median=median)


def _missing(recipe: Recipe) -> str:
    if not recipe.verification:
        return "verification poses"
    return (
        ""
        if getattr(recipe, "stability", None) is not None
        else "[stability] of the device, and [uncertainty] of the station"
    )


FIGURE = FigureKind(
    name="bias_error_period_ug",
    unit="µg",
    label="95 % bound of the largest rms error of an axis at the end of the period of validity",
    order=55,
    value=_value,
    missing=_missing,
)
