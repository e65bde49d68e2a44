"""The table was not at the commanded angles in one dwell."""

import numpy as np

from inertial.estimation.alternative import Array, OfOneDwell, tilts, without
from inertial.estimation.lot import Lot


class WrongPose(OfOneDwell):
    """A pose that the table missed once, for all units."""

    id = "wrong_pose"
    symbol = "Δα, Δβ"
    equation = "∂f/∂α·Δα + ∂f/∂β·Δβ in one dwell"
    breaker = "measure that pose again"

    def places(self, lot: Lot) -> list[dict[str, float]]:
        """Every dwell; none if the angles are unknown."""
        known = lot.state.outer is not None and lot.state.inner is not None
        there = np.flatnonzero(np.isfinite(lot.error).all(axis=-1).any(axis=0))
        return [{"at": float(k)} for k in there] if known else []

    def change(self, lot: Lot, slope: Array | None, **place: float) -> Array:
        """Errors of the two angles in one dwell."""
        here = np.arange(lot.state.time.shape[1]) == int(place["at"])
        return tilts(lot.state) * here[:, None, None]

    def every_dwell(self, lot: Lot) -> Array:
        """Errors of the two angles in each dwell."""
        return tilts(lot.state)

    def describe(self, lot: Lot, size: Array, **place: float) -> str:
        """The two angles."""
        angles = np.degrees(size)
        off = f"about {angles[0]:+.3f}° (outer) and {angles[1]:+.3f}° (inner)"
        return f"the pose was off by {off} for all units; the dwell is left out"

    def mended(self, lot: Lot, size: Array, **place: float) -> Lot | None:
        """Without the dwell: two angles identify it but do not correct it."""
        return without(lot, [int(place["at"])])

    def dwells(self, lot: Lot, **place: float) -> list[int]:
        """The one dwell."""
        return [int(place["at"])]
