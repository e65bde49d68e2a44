"""Output at 0 g minus its nominal value, of the worst axis."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, effect_in_model


def _value(tables: UnitTables) -> Value | None:
    return tables.coefficients.nearest("bias", 1e3, tables.guard, nominal=tables.coefficients.lot.zero_g)


FIGURE = FigureKind(
    name="zero_g_offset_mg",
    unit="mg",
    label="zero-g offset, worst axis",
    order=60,
    value=_value,
    missing=effect_in_model("bias"),
)
