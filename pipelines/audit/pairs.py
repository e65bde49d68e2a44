"""Pairs of calibrations of one unit: their times, changes and E_n."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.arrays import Array, Flags, Index
from inertial.population.comparison import e_n
from pipelines.audit.calibrations import Calibrations

YEAR_D = 365.25


@dataclass(frozen=True)
class Pairs:
    """Neighbouring calibrations of the same unit: rows of the later and of the earlier one, and the years between."""

    later: Index
    earlier: Index
    years: Array

    def chosen(self, which: Flags | Index) -> "Pairs":
        """The chosen pairs, in their order."""
        return Pairs(self.later[which], self.earlier[which], self.years[which])


def pairs_of(calibrations: Calibrations, good: Flags) -> Pairs:
    """Every good calibration with the previous good one of the same unit."""
    rows = np.flatnonzero(good)
    same_unit = calibrations.histories[rows[1:]] == calibrations.histories[rows[:-1]]
    return _pairs(calibrations, rows[1:][same_unit], rows[:-1][same_unit])


def _pairs(calibrations: Calibrations, later: Index, earlier: Index) -> Pairs:
    return Pairs(later, earlier, (calibrations.day[later] - calibrations.day[earlier]) / YEAR_D)


def changes_of(calibrations: Calibrations, pairs: Pairs, name: str) -> tuple[Array, Array]:
    """Change of a parameter over every pair, and the sum of both variances."""
    value, error = calibrations.column(name), calibrations.error(name)
    return value[pairs.later] - value[pairs.earlier], error[pairs.later] ** 2 + error[pairs.earlier] ** 2


def e_n_of(calibrations: Calibrations, pairs: Pairs, name: str, seating: tuple[float, float]) -> Array:
    """E_n of every pair; the mounting's variance is part of both uncertainties and is known only from the pairs of the kind.

    Parameters
    ----------
    seating : standard deviation of one mounting, and its degrees of freedom
    """
    value, (mount, known_from) = calibrations.column(name), seating
    error = np.hypot(calibrations.error(name), mount)
    total = error[pairs.later] ** 2 + error[pairs.earlier] ** 2
    share = np.maximum(2.0 * mount**2 / total, 1e-6)
    dof = known_from / share**2  # Welch and Satterthwaite (JCGM 100, G.4.1)
    return e_n(value[pairs.later], value[pairs.earlier], error[pairs.later], error[pairs.earlier], dof)


def spans_of(calibrations: Calibrations, pairs: Pairs) -> Pairs:
    """The last calibration of every unit with its first, where others lie between: long times separate slope from random walk."""
    unit = calibrations.histories[pairs.later]
    first, last = first_of_each(unit), last_of_each(unit)
    longer = last > first
    return _pairs(calibrations, pairs.later[last[longer]], pairs.earlier[first[longer]])


def first_of_each(values: NDArray[Any]) -> Index:
    """Places where a series of equal values begins."""
    return np.flatnonzero(np.append(True, values[1:] != values[:-1])[: values.size])


def last_of_each(values: NDArray[Any]) -> Index:
    """Places where a series of equal values ends."""
    return np.flatnonzero(np.append(values[1:] != values[:-1], True)[: values.size])
