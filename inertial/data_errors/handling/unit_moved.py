"""One unit turned in its seat during the run."""

from typing import ClassVar

import numpy as np

from inertial.estimation.alternative import Array, Handling, after, rotated_force, times, turns
from inertial.estimation.lot import Lot


class UnitMoved(Handling):
    """A unit that turned in its seat: a small rotation of the force from a dwell on."""

    id: ClassVar[str] = "unit_moved"
    symbol: ClassVar[str] = "δ(t)"
    equation: ClassVar[str] = "(δ × f)·H(t − t0), one unit"
    breaker: ClassVar[str] = "seat the unit again, and measure a pose of the first half once more"
    hides_behind: ClassVar[tuple[str, ...]] = ("misalignment_temperature",)
    fewest_units: ClassVar[int] = 1
    in_part: ClassVar[bool] = False

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every unit at every place in time."""
        units = lot.state.time.shape[0]
        return [{"unit": float(u), "dwell": float(k)} for u in range(units) for k in times(lot)]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """Three rotations of one unit."""
        force = np.broadcast_to(lot.state.force, (*lot.state.time.shape, 3))[int(place["unit"])]
        return (turns(force) * after(lot, place["dwell"])[:, None, None])[None]

    def of_each_unit(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """Three rotations."""
        return rotated_force(lot) * after(lot, place["dwell"])[:, None, None]

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The angle and its axis."""
        angle = float(np.linalg.norm(size))
        way = ", ".join(f"{v:+.2f}" for v in size / max(angle, 1e-30))
        return f"the unit turned by {1e3 * angle:.3f} mrad about ({way}) of the fixture; seat it again and repeat"
