"""Largest error of the norm in a pose not used by the fit, mean over the dwells of the pose."""

from __future__ import annotations

import numpy as np

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, largest_error, verification_poses


def _value(tables: UnitTables) -> Value | None:
    if not len(tables.verification):
        return None
    shown = largest_error(tables.verification_poses, "uncertainty_ug", tables.guard)
    shared = tables.stated_u("verification_norm", "norm")
    return shown._replace(uncertainty=float(np.hypot(shown.uncertainty, shared)), shared=shared)


FIGURE = FigureKind(
    name="verification_norm_ug",
    unit="µg",
    label="largest | |a| − g | of a pose not used, mean of its dwells",
    order=20,
    value=_value,
    missing=verification_poses,
)
