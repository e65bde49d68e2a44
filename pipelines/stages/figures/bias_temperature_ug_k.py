"""Change of the bias with temperature, of the worst axis."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, effect_in_model

FIGURE = FigureKind(
    name="bias_temperature_ug_K",
    unit="µg/K",
    label="bias over temperature, worst axis",
    order=80,
    value=lambda tables: tables.coefficients.nearest("bias_temperature", 1e6, tables.guard),
    missing=effect_in_model("bias_temperature"),
)
