from dataclasses import replace

import numpy as np

from inertial.estimation.alternative import Array, Handling, soaks
from inertial.estimation.lot import Lot
from inertial.state import History


class SoakThermometer(Handling):
    """An offset of the temperature reading in one soak, for all units."""

    id = "soak_thermometer"
    symbol = "ΔT"
    equation = "−∂E/∂T·ΔT in one soak, all units"
    breaker = "a second thermometer, or a soak at a fourth temperature"
    hides_behind = ("scale_temperature_quadratic", "bias_temperature_quadratic")

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Every soak, if there are more than two."""
        number = int(soaks(lot.state).max()) + 1
        return [{"soak": float(k)} for k in range(number)] if number > 2 else []

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The contribution of an offset of one kelvin, by each unit's temperature coefficients."""
        if slope is None:
            return np.zeros((*lot.state.time.shape, len(lot.state.axes), 1))
        return -(slope * (soaks(lot.state) == int(location["soak"]))[:, None])[..., None]

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return f"the thermometers read {self.short(size, **location)}; the readings are corrected by it"

    def instead(self, lot: Lot, **location: float) -> list[dict[str, float]]:
        """The other soaks: with three soaks and linear coefficients, an offset in one is equivalent to one in another."""
        number = int(soaks(lot.state).max()) + 1
        return [{**location, "soak": float(k)} for k in range(number) if k != int(location["soak"])]

    def short(self, size: Array, **location: float) -> str:
        return f"{size[0]:+.2f} K off in soak {int(location['soak']) + 1}"

    def mended(self, lot: Lot, size: Array, **location: float) -> Lot | None:
        """With the readings of the soak lowered by the offset, of one unit or of all."""
        state, wrong, offset = lot.state, soaks(lot.state) == int(location["soak"]), float(size[0])
        if state.temperature is None:
            return lot
        units = np.arange(state.time.shape[0])
        affected = (units == location.get("unit", units))[:, None]
        history = state.history
        if history is not None:
            during = (history.time >= state.time[0, wrong].min()) & (history.time <= state.time[0, wrong].max())
            history = History(history.time, history.temperature - offset * (affected & during))
        temperature = state.temperature - offset * (affected & wrong)
        return replace(lot, state=replace(state, temperature=temperature, history=history, memory={}))

    def dwells(self, lot: Lot, **location: float) -> list[int]:
        return np.flatnonzero(soaks(lot.state) == int(location["soak"])).tolist()
