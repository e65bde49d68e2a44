import numpy as np

from inertial.data_errors.handling.wrong_pose import WrongPose
from inertial.estimation.alternative import Array
from inertial.estimation.lot import Lot


class TableMoving(WrongPose):
    """A dwell measured while the table moved or shook, for all units: its mean force lies between those of two poses."""

    id = "table_moving"
    symbol = "Δα, Δβ, Δf/f"
    equation = "∂f/∂α·Δα + ∂f/∂β·Δβ + f·Δf/f in one dwell"
    breaker = "measure that pose again, after a longer wait"
    which = "for all units, as while the table moves; the dwell is left out"
    fewest_units = 3

    def errors(self, lot: Lot) -> Array:
        angles = super().errors(lot)
        force = np.broadcast_to(lot.state.force, (*lot.state.time.shape, 3))[: len(angles), ..., None]
        return np.concatenate([angles, force], axis=-1)

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return f"the mean force of the dwell was off by about {1e6 * float(np.linalg.norm(size)):.3g} µg {self.which}"
