import numpy as np

from inertial.data_errors.changes import AnglesOff
from inertial.estimation.alternative import Array, OfOneDwell, tilts
from inertial.estimation.lot import Lot


class WrongPose(AnglesOff, OfOneDwell):
    """A pose that the table missed once, for all units."""

    id = "wrong_pose"
    equation = "∂f/∂α·Δα + ∂f/∂β·Δβ in one dwell"
    breaker = "measure that pose again"
    which = "for all units; the dwell is left out"

    def places(self, lot: Lot) -> list[dict[str, float]]:
        """Every dwell; none if the angles are unknown."""
        known = lot.state.outer is not None and lot.state.inner is not None
        there = np.flatnonzero(np.isfinite(lot.error).all(axis=-1).any(axis=0))
        return [{"at": float(k)} for k in there] if known else []

    def every_dwell(self, lot: Lot) -> Array:
        return tilts(lot.state)

    def dwells(self, lot: Lot, **place: float) -> list[int]:
        return [int(place["at"])]
