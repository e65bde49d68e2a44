import numpy as np

from inertial.estimation.alternative import Array, OfOneDwell, common_force
from inertial.estimation.lot import Lot


class DwellTooEarly(OfOneDwell):
    """A dwell that began before the table stood, for all units: its mean holds a share of the pose before."""

    id = "dwell_too_early"
    symbol = "q"
    equation = "q·(f_before − f) in one dwell"
    breaker = "measure that pose again, after a longer wait"

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Every dwell after another one."""
        return [{"at": float(k)} for k in np.flatnonzero(lot.measured[1:] & lot.measured[:-1]) + 1]

    def every_dwell(self, lot: Lot) -> Array:
        force = common_force(lot)
        return (np.roll(force, 1, axis=1) - force)[..., None]

    def possible(self, size: Array) -> bool:
        return bool(0.0 < size[0] < 1.0)

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        share = 100.0 * float(size[0])
        return f"the dwell holds {share:.2g} % of the pose before, for all units; the dwell is left out"
