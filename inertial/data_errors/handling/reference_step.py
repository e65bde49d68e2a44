"""The reference of all units changed during the run: the reader's, or what the outputs are ratioed to."""

from typing import ClassVar

from inertial.estimation.alternative import Array, Handling, after, common_force, times
from inertial.estimation.lot import Lot


class ReferenceStep(Handling):
    """A scale of all units that changes by the same factor from a dwell on."""

    id: ClassVar[str] = "reference_step"
    symbol: ClassVar[str] = "g(t)"
    equation: ClassVar[str] = "g·f·H(t − t0), all units"
    breaker: ClassVar[str] = "another reader, or its reference measured"

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every place in time."""
        return [{"dwell": float(k)} for k in times(lot)]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The force."""
        return (common_force(lot) * after(lot, place["dwell"])[:, None])[..., None]

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The change."""
        return f"the scale factors of all units changed by {1e6 * size[0]:+.0f} ppm; look at the reader's reference"
