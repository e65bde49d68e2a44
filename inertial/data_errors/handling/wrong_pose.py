import numpy as np

from inertial.data_errors.changes import DirectionOff
from inertial.estimation.alternative import Array, OfOneDwell, pose_errors
from inertial.estimation.lot import Lot


class WrongPose(OfOneDwell, DirectionOff):
    """A pose that the table missed in one dwell, for all units."""

    id = "wrong_pose"
    equation = "∂f/∂α·Δα + ∂f/∂β·Δβ in one dwell"
    breaker = "measure that pose again"
    which = "for all units; the dwell is left out"

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Every dwell; none if the directions are unknown."""
        return [{"at": float(k)} for k in np.flatnonzero(lot.measured)] if pose_errors(lot.state).shape[-1] else []

    def every_dwell(self, lot: Lot) -> Array:
        return pose_errors(lot.state)
