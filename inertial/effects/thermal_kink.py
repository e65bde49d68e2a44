from dataclasses import replace

import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class ThermalKink(SensorEffect):
    """Bias whose slope over temperature changes at one temperature."""

    id = "thermal_kink"
    symbol = "kK"
    equation = "kK·w·softplus((T − Tc)/w)"
    coefficients = ("kK",)
    source = "mechanism: glass transition of an adhesive"
    typical_ug = (50.0, 5000.0)
    per = ("K",)
    hides_behind = ("bias_temperature_cubic", "bias_temperature_quadratic")
    breaker = "steps of 5 K about the kink"
    same_on_axes = True
    simplicity = 25
    after = ("bias_temperature",)
    nonlinear = (
        Nonlinear("centre", "degC", -40.0, 85.0, "linear", 12),
        Nonlinear("width", "K", 0.5, 8.0, "log", 3),
    )

    def columns(self, state: State, axis: int, *, centre: float, width: float, **nonlinear: float) -> Array:
        temperature = state.need("temperature", self.id)
        above = (temperature - centre) / width
        # np.logaddexp takes ten times as long
        return stack(state, [width * (np.maximum(above, 0.0) + np.log1p(np.exp(-np.abs(above))))])

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """The kink between the run's extreme temperatures: beyond them it is a straight line."""
        centre, width = self.nonlinear
        temperature = state.need("temperature", self.id)
        low, high = float(np.min(temperature)), float(np.max(temperature))
        margin = 0.05 * max(high - low, 1.0)
        return replace(centre, low=low + margin, high=max(high - margin, low + 2.0 * margin)), width
