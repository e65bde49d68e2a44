"""Bias instability B of the worst axis (IEEE Std 952)."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, static_record, worst_axis

FIGURE = FigureKind(
    name="bias_instability_ug",
    unit="µg",
    label="bias instability B, worst axis",
    order=110,
    value=lambda tables: worst_axis(tables.noise, "B", tables.guard),
    missing=static_record,
)
