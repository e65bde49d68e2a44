"""The thermometer of one unit has an offset in one soak."""

from typing import ClassVar

import numpy as np

from inertial.data_errors.handling.soak_thermometer import SoakThermometer, corrected
from inertial.estimation.alternative import Array, Exchangeable, soaks
from inertial.estimation.lot import Lot


class UnitThermometer(Exchangeable):
    """An offset of the temperature reading in one soak, for one unit."""

    id: ClassVar[str] = "unit_thermometer"
    symbol: ClassVar[str] = "ΔT"
    equation: ClassVar[str] = "−∂E/∂T·ΔT in one soak, one unit"
    breaker: ClassVar[str] = "a second thermometer, or a soak at a fourth temperature"
    hides_behind: ClassVar[tuple[str, ...]] = ("scale_temperature_quadratic", "bias_temperature_quadratic")
    fewest_units: ClassVar[int] = 1
    in_part: ClassVar[bool] = False

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every soak of every unit, if there are more than two soaks."""
        number = int(soaks(lot.state).max()) + 1
        units = lot.state.time.shape[0]
        return [{"unit": float(u), "soak": float(k)} for u in range(units) for k in range(number)] if number > 2 else []

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The contribution of an offset of one kelvin in the unit."""
        if slope is None:
            return np.zeros((1, lot.state.time.shape[1], 3, 1))
        own = slope[int(place["unit"])]
        return -(own * (soaks(lot.state) == int(place["soak"]))[:, None])[None, ..., None]

    def of_each_unit(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The contribution of an offset of one kelvin."""
        return SoakThermometer().change(lot, slope, **place)

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The offset."""
        return f"the thermometer of the unit reads {self.short(size, **place)}; its readings are corrected by it"

    def instead(self, lot: "Lot", **place: float) -> list[dict[str, float]]:
        """The other soaks."""
        return SoakThermometer().instead(lot, **place)

    def short(self, size: Array, **place: float) -> str:
        """The offset and the soak."""
        return SoakThermometer().short(size, **place)

    def mended(self, lot: "Lot", size: Array, **place: float) -> "Lot | None":
        """With the readings of the unit corrected in that soak."""
        return corrected(lot, soaks(lot.state) == int(place["soak"]), float(size[0]), int(place["unit"]))

    def dwells(self, lot: "Lot", **place: float) -> list[int]:
        """The dwells of the soak."""
        return np.flatnonzero(soaks(lot.state) == int(place["soak"])).tolist()
