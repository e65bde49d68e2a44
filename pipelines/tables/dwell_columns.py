"""Columns of dwells in the exchange format."""

from __future__ import annotations

from collections.abc import Iterable

from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS, KNOWN_COLUMNS, SPREAD_COLUMNS

REQUIRED = ("unit", "dwell", "time_s", "out_x", "out_y", "out_z")


FORCE = FORCE_COLUMNS


ANGLES = ANGLE_COLUMNS


DEVIATIONS = SPREAD_COLUMNS


KNOWN = KNOWN_COLUMNS


def is_exchange(names: Iterable[object]) -> bool:
    """Whether columns are those of a table of dwells in the exchange format."""
    return set(REQUIRED) <= {str(name) for name in names}
