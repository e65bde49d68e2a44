"""Base class of the effects on a centrifuge test, and the conditions of its points."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from inertial.arrays import Array, Flags
from inertial.dynamics.effect_modules import DynamicEffect


@dataclass(frozen=True)
class Spins:
    """The points of a test in the order of time, all (n,).

    acceleration : rω²/g of the nominal radius, g; negative where the unit is mounted the other way round
    radius_m : nominal radius, m
    order : time from the first to the last point, 0 to 1
    slowing : 1 where the point follows a faster one, else 0
    radius_error_m : standard uncertainty of each radius, m; it counts where there are several
    """

    acceleration: Array
    radius_m: Array
    order: Array
    slowing: Array
    radius_error_m: float = 0.0

    def picked(self, rows: Flags) -> "Spins":
        """The points of the selected rows (n,)."""
        return Spins(
            self.acceleration[rows], self.radius_m[rows], self.order[rows], self.slowing[rows], self.radius_error_m
        )


class CentrifugeEffect(DynamicEffect, ABC):
    """A term of the output, with a coefficient in ``unit``. Every module of this package defines one class."""

    unit: ClassVar[str]

    @abstractmethod
    def column(self, points: Spins) -> Array:
        """The term (n,) in g for a coefficient of 1."""

    def seen(self, points: Spins) -> bool:
        """Whether the points can show the effect besides bias and scale."""
        column = self.column(points)
        rest = np.column_stack([np.ones_like(column), points.acceleration])
        size = float(np.linalg.norm(column))
        left = column - rest @ np.linalg.lstsq(rest, column, rcond=None)[0]
        return size > 0.0 and float(np.linalg.norm(left)) > 1e-6 * size
