"""Names and factors that tables, documents and messages share."""

from collections.abc import Iterable
from typing import Literal

AXES: tuple[Literal["x"], Literal["y"], Literal["z"]] = ("x", "y", "z")
"""Sensor axes, in the order of every array and table."""


def axes_among(names: Iterable[object]) -> list[Literal["x", "y", "z"]]:
    """The sensor axes that are among some names, in order."""
    known = set(names)
    return [axis for axis in AXES if axis in known]


MICRO = 1e6
"""µg in one g, µrad in one rad."""

STANDARD_GRAVITY_M_S2 = 9.80665
"""m/s² in one g (CGPM 1901): the unit of specific force everywhere; the gravity of a place is another matter."""
