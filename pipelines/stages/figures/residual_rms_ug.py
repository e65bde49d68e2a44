"""Residual of the fit: root mean square over the dwells and axes of the fit."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, rms

FIGURE = FigureKind(
    name="residual_rms_ug",
    unit="µg",
    label="rms residual of the fit",
    order=10,
    value=lambda tables: rms(tables.residuals["residual_ug"]),
)
