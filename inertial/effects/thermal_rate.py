"""Bias in proportion to the rate of temperature: a gradient across the sensor."""

from typing import ClassVar

from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ThermalRate(SensorEffect):
    """Bias in proportion to the rate of temperature: a gradient across the sensor."""

    id: ClassVar[str] = "thermal_rate"
    symbol: ClassVar[str] = "kR"
    equation: ClassVar[str] = "kR·dT/dt"
    source: ClassVar[str] = "mechanism: gradient under a steady flow of heat"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 5000.0)
    hides_behind: ClassVar[tuple[str, ...]] = ("thermal_lag",)
    breaker: ClassVar[str] = "ramps at two rates; soaked readings never see it"
    simplicity: ClassVar[int] = 20

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        del axis, nonlinear
        rate = state.need("temperature_rate", self.id)
        return stack(state, [rate])

    def names(self, axis: int) -> tuple[str, ...]:
        del axis
        return ("kR",)
