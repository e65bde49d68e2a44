import numpy as np

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class ThermalLag(SensorEffect):
    """Bias that follows a part of the sensor which is later than its thermometer."""

    id = "thermal_lag"
    symbol = "kL"
    equation = "(kL + kL2·θ)·(T_lag − T)"
    coefficients = ("kL", "kL2")
    source = "first-order heat conduction between thermometer and sensing element"
    typical_ug = (10.0, 10000.0)
    per = ("K", "K²")
    hides_behind = ("thermal_rate", "bias_temperature")
    breaker = "a fast step of temperature, read while it settles"
    same_on_axes = True
    simplicity = 21
    memory = True
    primary = 1
    nonlinear = (Nonlinear("tau", "s", 5.0, 3000.0, "log", 14),)

    def columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:

        def lag(time: Array, temperature: Array) -> Array:
            return operators.first_order_lag(time, temperature, tau) - temperature

        behind = state.temperature_operator((self.id, tau), lag)
        return stack(state, [behind, behind * (state.need("theta", self.id))])

    def start_columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        return stack(state, [np.exp(-(state.time - state.time[..., :1]) / tau)])
