import numpy as np

from inertial.data_errors.changes import Change
from inertial.estimation.alternative import Array, rotated_force
from inertial.estimation.lot import Lot


class FixtureMoved(Change):
    """A fixture that turned on the table: the same small rotation for all units from a dwell on."""

    id = "fixture_moved"
    symbol = "δF(t)"
    equation = "(δ × f)·H(t − t0), all units"
    breaker = "tighten the fixture, and measure a pose of the first half once more"

    def addition(self, lot: Lot) -> Array:
        return rotated_force(lot)

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return f"all units {turned(size)}; tighten it and repeat"


def turned(size: Array) -> str:
    """A rotation (3,), rad, in words."""
    angle = float(np.linalg.norm(size))
    way = ", ".join(f"{v:+.2f}" for v in size / max(angle, 1e-30))
    return f"turned by {1e3 * angle:.3f} mrad about ({way}) of the fixture"
