from inertial.data_errors.changes import OfOneUnit
from inertial.data_errors.handling.soak_thermometer import SoakThermometer
from inertial.estimation.alternative import Array
from inertial.estimation.lot import Lot


class UnitThermometer(OfOneUnit, SoakThermometer):
    """An offset of the temperature reading in one soak, for one unit."""

    id = "unit_thermometer"
    equation = "−∂E/∂T·ΔT in one soak, one unit"
    fewest_units = 1

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return f"the thermometer of the unit reads {self.short(size, **location)}; its readings are corrected by it"
