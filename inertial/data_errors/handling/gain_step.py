"""One unit's gain changed during the run: its reading, its supply, its connector."""

from typing import ClassVar

import numpy as np

from inertial.estimation.alternative import Array, Handling, after, common_force, times
from inertial.estimation.lot import Lot


class GainStep(Handling):
    """A unit whose three scale factors change by the same factor from a dwell on."""

    id: ClassVar[str] = "gain_step"
    symbol: ClassVar[str] = "g(t)"
    equation: ClassVar[str] = "g·f·H(t − t0), one unit"
    breaker: ClassVar[str] = "another slot or another reader for the unit"
    fewest_units: ClassVar[int] = 1
    in_part: ClassVar[bool] = False

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every unit at every place in time."""
        units = lot.state.time.shape[0]
        return [{"unit": float(u), "dwell": float(k)} for u in range(units) for k in times(lot)]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The force of the unit."""
        force = np.broadcast_to(lot.state.force, (*lot.state.time.shape, 3))[int(place["unit"])]
        return (force * after(lot, place["dwell"])[:, None])[None, ..., None]

    def of_each_unit(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The force."""
        return (common_force(lot) * after(lot, place["dwell"])[:, None])[..., None]

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The change."""
        return f"all scale factors of the unit changed by {1e6 * size[0]:+.0f} ppm; look at its supply and reader"
