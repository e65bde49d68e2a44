from inertial.data_errors.changes import Change
from inertial.estimation.alternative import Array, common_force
from inertial.estimation.lot import Lot


class ReferenceStep(Change):
    """A scale of all units that changes by the same factor from a dwell on."""

    id = "reference_step"
    symbol = "g(t)"
    equation = "g·f·H(t − t0), all units"
    breaker = "another reader, or its reference measured"

    def addition(self, lot: Lot) -> Array:
        return common_force(lot)[..., None]

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return f"the scale factors of all units changed by {1e6 * size[0]:+.0f} ppm; look at the reader's reference"
