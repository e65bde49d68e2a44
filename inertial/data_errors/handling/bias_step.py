import numpy as np

from inertial.data_errors.changes import AXES, Change, OfOneUnit, every_dwell
from inertial.estimation.alternative import Array
from inertial.estimation.lot import Lot


class BiasStep(OfOneUnit, Change):
    """One unit whose bias changes on all axes from a dwell on, unlike that of any other unit.

    The case of a unit that was taken out and put back is under different stress, and a unit that fell has a different bias. As
    jumps of three axes it would need three locations, as an effect coefficients of all units.
    """

    id = "bias_step"
    symbol = "b(t)"
    equation = "b·H(t − t0), all axes of one unit"
    breaker = "a pose of the first half once more: a unit that was changed stays as it is"
    hides_behind = ("step_change",)

    def moments(self, lot: Lot) -> list[int]:
        return every_dwell(lot)

    def addition(self, lot: Lot) -> Array:
        axes = len(lot.state.axes)
        return np.broadcast_to(np.eye(axes), (1, lot.state.time.shape[1], axes, axes))

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        changes = ", ".join(
            f"{axis} {1e6 * v:+.0f}" for axis, v in zip((AXES[k] for k in lot.state.axes), size, strict=True)
        )
        return f"the bias of the unit changed on all axes ({changes} µg); measure the unit once more"
