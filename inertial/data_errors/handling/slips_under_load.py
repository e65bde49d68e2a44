import numpy as np

from inertial.arrays import Flags
from inertial.estimation.alternative import Array, Handling, common, tilts
from inertial.estimation.lot import Lot

_LOADS = 20
"""Largest number of candidate loads on each side at which the coupling may slip."""


class SlipsUnderLoad(Handling):
    """A coupling of the outer axis that slips at the largest torques: all poses beyond a load have the same angle error."""

    id = "slips_under_load"
    symbol = "εα(α)"
    equation = "∂f/∂α·εα where ±sin α exceeds a load"
    breaker = "tighten the coupling of the outer axis, and compare its angle with a level at both ends of its travel"
    hides_behind = ("encoder_harmonic", "outer_encoder_offset")
    fewest_units = 1

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Loads of either sign, between those of the poses, that fewer than half of the dwells exceed.

        Empty where the angles are unknown or differ between units.
        """
        if lot.state.outer is None or lot.state.inner is None or len(common(lot.state.outer)) > 1:
            return []
        found: list[dict[str, float]] = []
        for side in (1.0, -1.0):
            loads = np.unique(np.round(_load(lot, side), 3))
            limits = 0.5 * (loads[1:] + loads[:-1])
            beyond = np.array([np.mean(_load(lot, side) > limit) for limit in limits])
            limits = limits[beyond < 0.5]
            limits = limits[np.unique(np.linspace(0, limits.size - 1, min(limits.size, _LOADS)).astype(int))]
            found += [{"side": side, "load": float(limit)} for limit in limits]
        return found

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The change of force by the outer angle in the poses beyond the load."""
        return tilts(lot.state)[..., :1] * _overloaded(lot, **location)[:, None, None]

    def dwells(self, lot: Lot, **location: float) -> list[int]:
        """The dwells of the poses beyond the load."""
        return np.flatnonzero(_overloaded(lot, **location)).tolist()

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        """The angle error, and the poses that have it."""
        where = f"{'' if location['side'] > 0.0 else '-'}sin(outer) exceeds {location['load']:.2f}"
        return f"the outer angle is off by {np.degrees(size[0]):+.4f}° in the poses where {where}, for all units"


def _load(lot: Lot, side: float) -> Array:
    """Torque of the load about the outer axis over the largest, (n,), with the sign of one side."""
    return side * np.sin(lot.state.need("outer", SlipsUnderLoad.id).reshape(-1, lot.state.time.shape[-1])[0])


def _overloaded(lot: Lot, **location: float) -> Flags:
    """Dwells (n,) whose load exceeds that of the location."""
    return _load(lot, location["side"]) > location["load"]
