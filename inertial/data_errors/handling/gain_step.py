from inertial.data_errors.changes import OfOneUnit
from inertial.data_errors.handling.reference_step import ReferenceStep
from inertial.estimation.alternative import Array
from inertial.estimation.lot import Lot


class GainStep(OfOneUnit, ReferenceStep):
    """A unit whose three scale factors change by the same factor from a dwell on."""

    id = "gain_step"
    symbol = "g(t)"
    equation = "g·f·H(t − t0), one unit"
    breaker = "another slot or another reader for the unit"
    fewest_units = 1

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return f"all scale factors of the unit changed by {1e6 * size[0]:+.0f} ppm; look at its supply and reader"
