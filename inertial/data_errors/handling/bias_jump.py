from inertial.data_errors.changes import AXES, OfOneAxis, axes_of_units, every_dwell
from inertial.estimation.alternative import Array, after
from inertial.estimation.lot import Lot


class BiasJump(OfOneAxis):
    """One axis of one unit whose bias changes at a dwell: a jump that no other unit has.

    Telegraph (popcorn) noise of one sensor, a charge on its mechanism, particles and connectors make such jumps. Where several
    units jump at the same time, a step with a coefficient for every unit and axis explains more.
    """

    id = "bias_jump"
    symbol = "b(t)"
    equation = "b·H(t − t0), one axis of one unit"
    breaker = "the same poses once more: telegraph noise jumps back, a changed unit stays as it is"
    hides_behind = ("step_change",)
    several = True

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        return [{**axis, "dwell": float(k)} for axis in axes_of_units(lot) for k in every_dwell(lot)]

    def levels(self, lot: Lot, **location: float) -> Array:
        return after(lot, location["dwell"])[:, None]

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        axis = AXES[lot.state.axes[int(location["axis"])]]
        return f"the bias of axis {axis} of the unit changed by {1e6 * size[0]:+.0f} µg; measure the unit once more"
