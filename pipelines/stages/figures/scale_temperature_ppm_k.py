"""Change of the scale factor with temperature, of the worst axis."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, effect_in_model

FIGURE = FigureKind(
    name="scale_temperature_ppm_K",
    unit="ppm/K",
    label="scale over temperature, worst axis",
    order=90,
    value=lambda tables: tables.coefficients.nearest("scale_temperature", 1e6, tables.guard),
    missing=effect_in_model("scale_temperature"),
)
