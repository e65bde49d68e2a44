"""Rate random walk K of the worst axis (IEEE Std 952)."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, static_record, worst_axis

FIGURE = FigureKind(
    name="rate_random_walk_ug_rts",
    unit="µg/√s",
    label="rate random walk K, worst axis",
    order=120,
    value=lambda tables: worst_axis(tables.noise, "K", tables.guard),
    missing=static_record,
)
