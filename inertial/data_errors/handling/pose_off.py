import numpy as np

from inertial.data_errors.changes import DirectionOff
from inertial.estimation.alternative import pose_errors, poses
from inertial.estimation.lot import Lot


class PoseOff(DirectionOff):
    """A pose that is wrong in all its dwells, for all units."""

    id = "pose_off"
    equation = "∂f/∂α·Δα + ∂f/∂β·Δβ in every dwell of one pose"
    breaker = "check the angles of that pose in the recipe, and measure it again"
    which = "every time; its dwells are left out"
    fewest_units = 1

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Every pose with more than one dwell; none if the directions are unknown."""
        if not pose_errors(lot.state).shape[-1]:
            return []
        number, count = np.unique(poses(lot)[lot.measured], return_counts=True)
        several = number[count > 1]
        return [{"pose": float(k)} for k in several] if several.size > 3 * int(count.max() > 1) else []

    def dwells(self, lot: Lot, **location: float) -> list[int]:
        return np.flatnonzero(poses(lot) == int(location["pose"])).tolist()
