"""Names and factors that tables, documents and messages share."""

from typing import Literal

AXES: tuple[Literal["x"], Literal["y"], Literal["z"]] = ("x", "y", "z")
"""Sensor axes, in the order of every array and table."""

MICRO = 1e6
"""µg in one g, µrad in one rad."""

STANDARD_GRAVITY_M_S2 = 9.80665
"""m/s² in one g (CGPM 1901): the unit of specific force everywhere; the gravity of a place is another matter."""
