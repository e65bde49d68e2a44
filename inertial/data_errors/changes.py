"""Base classes of handling errors: a change from a dwell on, an error of one unit, of a single axis, of the pose angles."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from inertial.estimation.alternative import Array, Handling, after, pose_errors, times, without
from inertial.estimation.lot import Lot

AXES = "xyz"

_EVERY = 160
"""Largest number of dwells for which a jump is searched at every dwell."""


def every_dwell(lot: Lot) -> list[int]:
    """Candidate first dwells of a changed bias.

    A jump located one dwell off explains half of it, while a step in time between two dwells explains all of it. A jump after
    the first dwell, or before the last, is one bad dwell.
    """
    n = lot.state.time.shape[1]
    return list(range(2, n - 1)) if n <= _EVERY else times(lot)


class Change(Handling):
    """A change of all units from a dwell on."""

    @abstractmethod
    def addition(self, lot: Lot) -> Array:
        """Columns (units or 1, n, 3, k), g per unit of the coefficient, of the change if it were present in all dwells."""

    def moments(self, lot: Lot) -> list[int]:
        """Candidate first dwells of the change."""
        return times(lot)

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """The candidate first dwells as locations."""
        return [{"dwell": float(k)} for k in self.moments(lot)]

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """:meth:`addition`, zero before the dwell."""
        return self.addition(lot) * after(lot, location["dwell"])[:, None, None]


class OfOneUnit(Handling):
    """The error of the next base class, restricted to one unit."""

    in_part = False

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Every unit at every location of the error of all units."""
        of_lot = super().locations(lot)
        return [{"unit": float(u), **location} for u in range(lot.state.time.shape[0]) for location in of_lot]

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The columns of the unit."""
        of_units = self.of_each_unit(lot, slope, **location)
        unit = int(location["unit"])
        return of_units[unit : unit + 1] if len(of_units) > 1 else of_units

    def of_each_unit(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The columns of the error of all units."""
        return super().change(lot, slope, **location)


class OfOneAxis(Handling):
    """An error of the bias of one axis of one unit, which no other unit has."""

    fewest_units = 1
    in_part = False
    of_one_axis = True

    @abstractmethod
    def levels(self, lot: Lot, **location: float) -> Array:
        """Columns (n, k) of the axis, g per unit of the coefficient."""

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The columns of the axis; none in the others."""
        levels = self.levels(lot, **location)
        column = np.zeros((1, len(levels), len(lot.state.axes), levels.shape[-1]))
        column[0, :, int(location["axis"])] = levels
        return column

    def of_each_unit(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The columns of the axis, equal in every unit."""
        return self.change(lot, slope, **location)


class DirectionOff(Handling):
    """A wrong direction in some dwells of all units; the dwells are left out, not corrected by the two fitted angles.

    which : text that says which dwells are wrong and left out
    """

    symbol = "Δα, Δβ"
    which: ClassVar[str]

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The two errors in the dwells."""
        here = np.isin(np.arange(lot.state.time.shape[1]), self.dwells(lot, **location))
        return pose_errors(lot.state) * here[:, None, None]

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        """The two angles of a table; of stated forces the angle between the two directions."""
        angles = np.degrees(size)
        if lot.state.outer is None:
            return f"the pose was off by about {float(np.linalg.norm(angles)):.3f}° {self.which}"
        return f"the pose was off by about {angles[0]:+.3f}° (outer) and {angles[1]:+.3f}° (inner) {self.which}"

    def mended(self, lot: Lot, size: Array, **location: float) -> Lot | None:
        """The lot without these dwells."""
        return without(lot, self.dwells(lot, **location))


def axes_of_units(lot: Lot) -> list[dict[str, float]]:
    """Every axis of every unit, as locations."""
    units = lot.state.time.shape[0]
    return [{"unit": float(u), "axis": float(axis)} for u in range(units) for axis in range(len(lot.state.axes))]
