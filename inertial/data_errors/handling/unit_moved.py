from inertial.data_errors.changes import OfOneUnit
from inertial.data_errors.handling.fixture_moved import FixtureMoved, turned
from inertial.estimation.alternative import Array
from inertial.estimation.lot import Lot


class UnitMoved(OfOneUnit, FixtureMoved):
    """A unit that turned in its seat: a small rotation of the force from a dwell on."""

    id = "unit_moved"
    symbol = "δ(t)"
    equation = "(δ × f)·H(t − t0), one unit"
    breaker = "seat the unit again, and measure a pose of the first half once more"
    hides_behind = ("misalignment_temperature",)
    fewest_units = 1

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return f"the unit {turned(size)}; seat it again and repeat"
