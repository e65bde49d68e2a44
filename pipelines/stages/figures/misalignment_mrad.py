"""Misalignment: the largest cross-axis coefficient over the scale factor, an angle."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, effect_in_model

FIGURE = FigureKind(
    name="misalignment_mrad",
    unit="mrad",
    label="misalignment, worst",
    order=70,
    value=lambda tables: tables.coefficients.nearest("misalignment", 1e3, tables.guard),
    missing=effect_in_model("misalignment"),
)
