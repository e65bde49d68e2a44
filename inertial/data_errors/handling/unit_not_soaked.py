"""One unit lagged the temperature reading: it had not soaked, or its contact with the plate is poor."""

from typing import ClassVar

from inertial.data_errors.handling.not_soaked import NotSoaked
from inertial.estimation.alternative import Array
from inertial.estimation.lot import Lot


class UnitNotSoaked(NotSoaked):
    """A temperature of one unit that relaxes to the reading with its own time constant."""

    id: ClassVar[str] = "unit_not_soaked"
    equation: ClassVar[str] = "E(T_d) − E(T), T_d′ = (T − T_d)/τ, one unit"
    fewest_units: ClassVar[int] = 2

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every unit at every time constant."""
        units = lot.state.time.shape[0]
        return [{"unit": float(u), **place} for u in range(units) for place in super(UnitNotSoaked, self).places(lot)]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The contribution of the lag in the unit."""
        unit = int(place["unit"])
        return super().change(lot, slope, **place)[unit : unit + 1]

    def of_each_unit(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The contribution of the lag."""
        return super().change(lot, slope, **place)
