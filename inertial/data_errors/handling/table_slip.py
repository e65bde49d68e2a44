from inertial.data_errors.changes import Change
from inertial.estimation.alternative import Array, tilts
from inertial.estimation.lot import Lot


class TableSlip(Change):
    """A table whose angles have offsets from a dwell on."""

    id = "table_slip"
    symbol = "εα, εβ(t)"
    equation = "(∂f/∂α·εα + ∂f/∂β·εβ)·H(t − t0)"
    breaker = "home the table, and measure a pose of the first half once more"
    hides_behind = ("outer_encoder_offset",)
    fewest_units = 1

    def moments(self, lot: Lot) -> list[int]:
        """The dwells from which on a change is possible; none if the angles are unknown."""
        return [] if lot.state.outer is None or lot.state.inner is None else super().moments(lot)

    def addition(self, lot: Lot) -> Array:
        return tilts(lot.state)

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        off = f"{1e3 * size[0]:+.3f} mrad (outer) and {1e3 * size[1]:+.3f} mrad (inner)"
        return f"the table's angles changed by {off}; home it and repeat"
