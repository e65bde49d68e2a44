"""The bias of one unit changed on all of its axes during the run."""

from typing import ClassVar

import numpy as np

from inertial.data_errors.handling.bias_jump import AXES, every_dwell
from inertial.estimation.alternative import Array, Handling, after
from inertial.estimation.lot import Lot


class BiasStep(Handling):
    """One unit whose bias is another on all axes from a dwell on, and no other unit's.

    A unit that was taken out and put back has another stress in its case, a unit that fell has another bias. As the jumps of
    three axes it would need three places in time, as an effect the coefficients of all units.
    """

    id: ClassVar[str] = "bias_step"
    symbol: ClassVar[str] = "b(t)"
    equation: ClassVar[str] = "b·H(t − t0), all axes of one unit"
    breaker: ClassVar[str] = "a pose of the first half once more: a unit that was changed stays as it is"
    hides_behind: ClassVar[tuple[str, ...]] = ("step_change",)
    fewest_units: ClassVar[int] = 2
    in_part: ClassVar[bool] = False

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every unit at every place in time; none where only a norm is known."""
        units = 0 if lot.radial else lot.state.time.shape[0]
        return [{"unit": float(u), "dwell": float(k)} for u in range(units) for k in every_dwell(lot)]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """One in each axis from the dwell on."""
        return self.of_each_unit(lot, slope, dwell=place["dwell"])

    def of_each_unit(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The same for every unit."""
        return (after(lot, place["dwell"])[:, None, None] * np.eye(len(AXES)))[None]

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The change of each axis."""
        changes = ", ".join(f"{axis} {1e6 * v:+.0f}" for axis, v in zip(AXES, size, strict=True))
        return f"the bias of the unit changed on all axes ({changes} µg); measure the unit once more"
