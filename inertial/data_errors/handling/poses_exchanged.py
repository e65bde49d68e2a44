from dataclasses import replace

import numpy as np

from inertial.estimation.alternative import Array, Handling, common_force
from inertial.estimation.lot import Lot

_APART = 0.05
"""Distance of two forces, g, above which they belong to different poses."""


class PosesExchanged(Handling):
    """Poses of two successive dwells recorded in the wrong order, for all units; its only possible coefficient is 1."""

    id = "poses_exchanged"
    symbol = "a ↔ b"
    equation = "f_b − f_a in dwell a, the opposite in dwell b"
    breaker = "the log of the table, or both poses once more"
    of_one = 1.25  # an exchange changes the force by the full difference of the poses

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Each dwell whose successor has another pose."""
        step = np.linalg.norm(np.diff(common_force(lot), axis=-2), axis=-1).max(axis=0)
        both = lot.measured[:-1] & lot.measured[1:]
        return [{"at": float(k)} for k in np.flatnonzero((step > _APART) & both)]

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        first, force = int(location["at"]), common_force(lot)
        column = np.zeros((*force.shape, 1))
        column[:, first, :, 0] = force[:, first + 1] - force[:, first]
        column[:, first + 1, :, 0] = force[:, first] - force[:, first + 1]
        return column

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        force = common_force(lot)[0]
        first = int(location["at"])
        apart = np.degrees(np.arccos(np.clip(float(force[first] @ force[first + 1]), -1.0, 1.0)))
        return f"the poses of this dwell and the next, {apart:.0f}° apart, were exchanged for all units; they are exchanged back"

    def mended(self, lot: Lot, size: Array, **location: float) -> Lot | None:
        first = int(location["at"])
        order = np.arange(lot.state.time.shape[1])
        order[[first, first + 1]] = order[[first + 1, first]]
        known = {name: getattr(lot.state, name) for name in ("outer", "inner", "heading", "force", "felt")}
        turned = {
            name: values[..., order, :] if name in {"force", "felt"} else values[..., order]
            for name, values in known.items()
            if values is not None
        }
        return replace(lot, state=replace(lot.state, **turned, memory={}))

    def dwells(self, lot: Lot, **location: float) -> list[int]:
        return [int(location["at"]), int(location["at"]) + 1]
