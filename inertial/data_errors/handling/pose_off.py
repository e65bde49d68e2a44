"""The table was not at the commanded angles in every dwell of one pose."""

import numpy as np

from inertial.estimation.alternative import Array, Handling, poses, tilts, without
from inertial.estimation.lot import Lot


class PoseOff(Handling):
    """A pose that is wrong every time, for all units."""

    id = "pose_off"
    symbol = "Δα, Δβ"
    equation = "∂f/∂α·Δα + ∂f/∂β·Δβ in every dwell of one pose"
    breaker = "check the angles of that pose in the recipe, and measure it again"
    fewest_units = 1

    def places(self, lot: Lot) -> list[dict[str, float]]:
        """Every pose with more than one dwell; none if the angles are unknown."""
        if lot.state.outer is None or lot.state.inner is None:
            return []
        there = np.isfinite(lot.error).all(axis=-1).any(axis=0)
        number, count = np.unique(poses(lot)[there], return_counts=True)
        several = number[count > 1]
        return [{"pose": float(k)} for k in several] if several.size > 3 * int(count.max() > 1) else []

    def change(self, lot: Lot, slope: Array | None, **place: float) -> Array:
        """Errors of the two angles in the dwells of one pose."""
        return tilts(lot.state) * (poses(lot) == int(place["pose"]))[:, None, None]

    def describe(self, lot: Lot, size: Array, **place: float) -> str:
        """The two angles."""
        angles = np.degrees(size)
        off = f"about {angles[0]:+.3f}° (outer) and {angles[1]:+.3f}° (inner)"
        return f"the pose was off by {off} every time; its dwells are left out"

    def mended(self, lot: Lot, size: Array, **place: float) -> Lot | None:
        """Without the dwells of the pose."""
        return without(lot, self.dwells(lot, **place))

    def dwells(self, lot: Lot, **place: float) -> list[int]:
        """The dwells of the pose."""
        return np.flatnonzero(poses(lot) == int(place["pose"])).tolist()
