"""Columns of dwells in the exchange format."""

from __future__ import annotations

from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS, KNOWN_COLUMNS, SPREAD_COLUMNS

REQUIRED = ("unit", "dwell", "time_s", "out_x", "out_y", "out_z")


FORCE = FORCE_COLUMNS


ANGLES = ANGLE_COLUMNS


DEVIATIONS = SPREAD_COLUMNS


KNOWN = KNOWN_COLUMNS
