"""Largest error of verification over the error that its uncertainty allows."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, verification_poses

ALARM = 0.01  # probability that a good unit shows an error beyond what the uncertainty allows


def _value(tables: UnitTables) -> Value | None:
    """The allowed error is the two-sided quantile of a normal distribution, 1 % shared by all dwells."""
    rows = tables.verification
    if not len(rows):
        return None
    quantile = -float(ndtri(0.5 * ALARM / len(rows)))
    return Value(float(np.max(np.abs(rows["error_ug"]) / (quantile * rows["uncertainty_ug"]))), 0.0)


FIGURE = FigureKind(
    name="verification_ratio",
    unit="1",
    label="largest error over what the uncertainty allows",
    order=40,
    value=_value,
    missing=verification_poses,
)
