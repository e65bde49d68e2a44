"""Largest error of the norm in a single dwell of verification."""

from __future__ import annotations

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, largest_error, verification_poses


def _value(tables: UnitTables) -> Value | None:
    """The wander of the device is part of a single dwell's value; the noise of the reading is its uncertainty."""
    if not len(tables.verification):
        return None
    return largest_error(tables.verification, "reading_ug", tables.guard)


FIGURE = FigureKind(
    name="verification_dwell_ug",
    unit="µg",
    label="largest | |a| − g | of a single dwell there",
    order=30,
    value=_value,
    missing=verification_poses,
)
