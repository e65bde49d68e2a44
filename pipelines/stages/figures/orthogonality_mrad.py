"""Deviation from 90° of the angle between two axes, the largest: independent of the seat in the fixture."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, effect_in_model


def _value(tables: UnitTables) -> Value | None:
    lot, unit = tables.coefficients
    angles = [lot.angle(unit, first, second) for first, second in ((0, 1), (1, 2), (2, 0))]
    values = [Value(1e3 * one[0], 1e3 * one[1]) for one in angles if one is not None]
    return max(values, key=lambda value: value.reach(tables.guard)) if values else None


FIGURE = FigureKind(
    name="orthogonality_mrad",
    unit="mrad",
    label="deviation of the angle between two axes from 90°, worst",
    order=72,
    value=_value,
    missing=effect_in_model("misalignment"),
)
