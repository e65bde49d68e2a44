"""Error of the worst axis on poses not used by the fit, root mean square."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, rms, verification_poses
from schemas.units import AXES


def _value(tables: UnitTables) -> Value | None:
    if not len(tables.verification):
        return None
    return max((rms(tables.verification[f"error_{axis}_ug"]) for axis in AXES), key=lambda axis: axis.value)


FIGURE = FigureKind(
    name="bias_error_ug",
    unit="µg",
    label="rms error of the worst axis on poses not used",
    order=50,
    value=_value,
    missing=verification_poses,
)
