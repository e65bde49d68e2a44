"""Velocity random walk N of the worst axis, two-sided as in IEEE Std 952."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, static_record, worst_axis

FIGURE = FigureKind(
    name="velocity_random_walk_ug_rtHz",
    unit="µg/√Hz",
    label="velocity random walk N, worst axis",
    order=100,
    value=lambda tables: worst_axis(tables.noise, "N", tables.guard),
    missing=static_record,
)
