"""The fixture moved with all its units during the run."""

from typing import ClassVar

import numpy as np

from inertial.estimation.alternative import Array, Handling, after, rotated_force, times
from inertial.estimation.lot import Lot


class FixtureMoved(Handling):
    """A fixture that turned on the table: the same small rotation for all units from a dwell on."""

    id: ClassVar[str] = "fixture_moved"
    symbol: ClassVar[str] = "δF(t)"
    equation: ClassVar[str] = "(δ × f)·H(t − t0), all units"
    breaker: ClassVar[str] = "tighten the fixture, and measure a pose of the first half once more"

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every place in time."""
        return [{"dwell": float(k)} for k in times(lot)]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """Three rotations, the same for all units."""
        return rotated_force(lot) * after(lot, place["dwell"])[:, None, None]

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The angle and its axis."""
        angle = float(np.linalg.norm(size))
        way = ", ".join(f"{v:+.2f}" for v in size / max(angle, 1e-30))
        return f"all units turned by {1e3 * angle:.3f} mrad about ({way}) of the fixture; tighten it and repeat"
