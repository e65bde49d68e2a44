from collections.abc import Mapping

import numpy as np

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class SupplySensitivity(SensorEffect):
    """Bias and scale factor that follow the supply voltage."""

    id = "supply_sensitivity"
    symbol = "kV"
    equation = "kV·ΔV + K1V·ΔV·(fi + δj·fj + δk·fk)"
    coefficients = ("kV", "K1V")
    source = "mechanism: ratiometric output; power-supply rejection"
    typical_ug = (1.0, 5000.0)
    per = ("V", "g·V")
    hides_behind = ("bias_temperature",)
    breaker = "steps of the supply at constant temperature"
    simplicity = 35
    sharp = True
    primary = 1

    def columns(self, state: State, axis: int, *, nominal: float, **nonlinear: float) -> Array:
        change = state.need("supply", self.id) - nominal
        return stack(state, [change, change * state.along(axis)])

    def constants(self, state: State) -> Mapping[str, float]:
        """The mean supply of the run, V: changes count from there."""
        return {"nominal": float(np.mean(state.need("supply", self.id)))}
