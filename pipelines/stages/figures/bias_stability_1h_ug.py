"""Bias stability over one hour: standard deviation of 100 s means in the last hour of the static record, worst axis."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, worst_axis
from pipelines.stages.noise import HOUR_S, TERM
from schemas.recipe import Recipe


def _value(tables: UnitTables) -> Value | None:
    if not len(tables.noise) or TERM not in set(tables.noise["term"].tolist()):
        return None
    return worst_axis(tables.noise, TERM, tables.guard)


def _missing(recipe: Recipe) -> str:
    return "" if recipe.static_record_s >= HOUR_S else f"a static record of an hour (static_record_s >= {HOUR_S:g})"


FIGURE = FigureKind(
    name="bias_stability_1h_ug",
    unit="µg",
    label="bias stability over 1 h, standard deviation of 100 s means, worst axis",
    order=112,
    value=_value,
    missing=_missing,
)
