"""Error expected over the period of validity, root mean square, worst axis: run, references, flicker, switch-on, ageing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.stages.figures.base import FigureKind, UnitTables, Value
from schemas.units import AXES

if TYPE_CHECKING:
    from schemas.recipe import Recipe


def _value(tables: UnitTables) -> Value | None:
    rows = [tables.budget[key] for key in (("bias_error_period", axis) for axis in AXES) if key in tables.budget]
    if not rows:
        return None
    return max((Value(row.value, row.u) for row in rows), key=lambda value: value.reach(tables.guard))


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
    label="rms error of the worst axis expected over the period of validity",
    order=55,
    value=_value,
    missing=_missing,
)
