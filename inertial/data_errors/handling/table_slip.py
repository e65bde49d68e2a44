"""The table slipped on its drives during the run."""

from typing import ClassVar

from inertial.estimation.alternative import Array, Handling, after, tilts, times
from inertial.estimation.lot import Lot


class TableSlip(Handling):
    """A table whose angles have offsets from a dwell on."""

    id: ClassVar[str] = "table_slip"
    symbol: ClassVar[str] = "εα, εβ(t)"
    equation: ClassVar[str] = "(∂f/∂α·εα + ∂f/∂β·εβ)·H(t − t0)"
    breaker: ClassVar[str] = "home the table, and measure a pose of the first half once more"
    hides_behind: ClassVar[tuple[str, ...]] = ("outer_encoder_offset",)
    fewest_units: ClassVar[int] = 1

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every place in time; none if the angles are unknown."""
        return [] if lot.state.outer is None or lot.state.inner is None else [{"dwell": float(k)} for k in times(lot)]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """Errors of the two angles."""
        return tilts(lot.state) * after(lot, place["dwell"])[:, None, None]

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The two angles."""
        off = f"{1e3 * size[0]:+.3f} mrad (outer) and {1e3 * size[1]:+.3f} mrad (inner)"
        return f"the table's angles changed by {off}; home it and repeat"
