from typing import ClassVar

import numpy as np

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class ThermalLag(SensorEffect):
    """Bias that follows a part of the sensor which is later than its thermometer."""

    id: ClassVar[str] = "thermal_lag"
    symbol: ClassVar[str] = "kL"
    equation: ClassVar[str] = "(kL + kL2·θ)·(T_lag − T)"
    coefficients: ClassVar[tuple[str, ...]] = ("kL", "kL2")
    source: ClassVar[str] = "first-order heat conduction between thermometer and sensing element"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 10000.0)
    per: ClassVar[tuple[str, ...]] = ("K", "K²")
    hides_behind: ClassVar[tuple[str, ...]] = ("thermal_rate", "bias_temperature")
    breaker: ClassVar[str] = "a fast step of temperature, read while it settles"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 21
    memory: ClassVar[bool] = True
    primary: ClassVar[int | None] = 1
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("tau", "s", 5.0, 3000.0, "log", 14),)

    def columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:

        def lag(time: Array, temperature: Array) -> Array:
            return operators.first_order_lag(time, temperature, tau) - temperature

        behind = state.temperature_operator((self.id, tau), lag)
        return stack(state, [behind, behind * (state.need("theta", self.id))])

    def start_columns(self, state: State, axis: int, *, tau: float, **nonlinear: float) -> Array:
        return stack(state, [np.exp(-(state.time - state.time[..., :1]) / tau)])
