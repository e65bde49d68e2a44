"""The bias of one axis of one unit changed during the run."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from inertial.estimation.alternative import Array, Handling, after, times
from inertial.estimation.lot import Lot

AXES = "xyz"

_EVERY = 160
"""Dwells up to which each is a place."""


def every_dwell(lot: "Lot") -> Sequence[int]:
    """Dwells from which on a bias may have changed.

    A jump that is missed by one dwell explains half of itself, and a step in time between two dwells all of it.
    """
    n = lot.state.time.shape[1]
    return range(1, n) if n <= _EVERY else times(lot)


class BiasJump(Handling):
    """One axis of one unit whose bias is another from a dwell on: a jump of its own, which no other unit has.

    Telegraph (popcorn) noise of one sensor, a charge on its mechanism, particles and connectors make such jumps. Where several
    units jump at the same time, a step with a coefficient for every unit and axis explains more.
    """

    id: ClassVar[str] = "bias_jump"
    symbol: ClassVar[str] = "b(t)"
    equation: ClassVar[str] = "b·H(t − t0), one axis of one unit"
    breaker: ClassVar[str] = "the same poses once more: telegraph noise jumps back, a changed unit stays as it is"
    hides_behind: ClassVar[tuple[str, ...]] = ("step_change",)
    fewest_units: ClassVar[int] = 1
    in_part: ClassVar[bool] = False
    of_one_axis: ClassVar[bool] = True
    several: ClassVar[bool] = True

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every axis of every unit at every place in time; none where only a norm is known."""
        if lot.radial:
            return []
        units = lot.state.time.shape[0]
        return [
            {"unit": float(u), "axis": float(axis), "dwell": float(k)}
            for u in range(units)
            for axis in range(len(AXES))
            for k in every_dwell(lot)
        ]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """One from the dwell on, of the axis."""
        return self.of_each_unit(lot, slope, axis=place["axis"], dwell=place["dwell"])

    def of_each_unit(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The same for every unit."""
        column = np.zeros((1, lot.state.time.shape[1], len(AXES), 1))
        column[0, :, int(place["axis"]), 0] = after(lot, place["dwell"])
        return column

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The axis and the change."""
        axis = AXES[int(place["axis"])]
        return f"the bias of axis {axis} of the unit changed by {1e6 * size[0]:+.0f} µg; measure the unit once more"
