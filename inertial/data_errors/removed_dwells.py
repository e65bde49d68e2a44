"""Single dwells of single units that are left out, and models without them."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array
from inertial.estimation.lot import Lot
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem

DwellIndex = tuple[int, int]
"""Index of a unit and index of a dwell."""


@dataclass(frozen=True)
class BadDwell:
    """A bad dwell of one unit, with its deletion residual.

    off : (axes,), g, deviation; by_axis : (axes,), the same in standard deviations; tail : whether it is within the noise's tails
    """

    unit: int
    dwell: int
    off: Array
    by_axis: Array
    tail: bool = False

    @property
    def index(self) -> DwellIndex:
        """Indices of its unit and dwell."""
        return self.unit, self.dwell

    @property
    def deviations(self) -> float:
        """Length of the deviation, standard deviations."""
        return float(np.linalg.norm(self.by_axis))


def without(lot: Lot, removed: Iterable[DwellIndex]) -> Lot:
    """The lot without some dwells of some units."""
    error = lot.error.copy()
    for index in removed:
        error[index] = np.inf
    return replace(lot, error=error)


def model_without(model: Model, removed: Iterable[DwellIndex]) -> Model:
    """The model in the lot without some dwells, its noise estimated again."""
    problem = Problem(without(model.problem.lot, removed), slope=model.problem.slope)
    return Model(problem, model.terms, near=model.noise)
