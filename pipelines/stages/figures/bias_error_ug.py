"""Error of the worst axis on poses not used by the fit, root mean square."""

from __future__ import annotations

import numpy as np

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, rms, verification_poses
from pipelines.tables.frames import UnitRows
from schemas.units import AXES


def _value(tables: UnitTables) -> Value | None:
    if not len(tables.verification):
        return None
    return max(
        (_as_met(tables, axis) for axis in AXES if f"error_{axis}_ug" in tables.verification),
        key=lambda value: value.reach(tables.guard),
    )


def _as_met(tables: UnitTables, axis: str) -> Value:
    """RMS error of one axis with its uncertainty for the user: that of the verification, and that of the references."""
    shown = _of_axis(tables.verification, axis)
    shared = tables.stated_u("bias_error", axis)
    return shown._replace(uncertainty=float(np.hypot(shown.uncertainty, shared)), shared=shared)


def _of_axis(rows: UnitRows, axis: str) -> Value:
    """RMS error of one axis, with the uncertainty of the verification's covariance.

    See :func:`pipelines.stages.rms_error.rms_uncertainty`. Runs of earlier versions have the uncertainty of white noise alone.
    """
    name, plain = f"rms_uncertainty_{axis}_ug", rms(rows[f"error_{axis}_ug"])
    return plain._replace(uncertainty=float(rows[name][0])) if name in rows else plain


FIGURE = FigureKind(
    name="bias_error_ug",
    unit="µg",
    label="rms error of the worst axis on poses not used",
    order=50,
    value=_value,
    missing=verification_poses,
)
