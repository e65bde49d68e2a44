from typing import ClassVar

from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class ThermalRate(SensorEffect):
    """Bias in proportion to the rate of temperature: a gradient across the sensor, which settles within a minute."""

    id: ClassVar[str] = "thermal_rate"
    symbol: ClassVar[str] = "kR"
    equation: ClassVar[str] = "kR·dT/dt, over a settling time τ"
    coefficients: ClassVar[tuple[str, ...]] = ("kR",)
    source: ClassVar[str] = "mechanism: gradient under a steady flow of heat"
    typical_ug: ClassVar[tuple[float, float]] = (10.0, 5000.0)
    per: ClassVar[tuple[str, ...]] = ("(K/min)",)
    hides_behind: ClassVar[tuple[str, ...]] = ("thermal_lag",)
    breaker: ClassVar[str] = "ramps at two rates; soaked readings never see it"
    same_on_axes: ClassVar[bool] = True
    simplicity: ClassVar[int] = 20
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = (Nonlinear("settling", "s", 4.0, 60.0, "log", 4),)

    def columns(self, state: State, axis: int, *, settling: float, **nonlinear: float) -> Array:

        def rate(time: Array, temperature: Array) -> Array:
            return 60.0 * (temperature - operators.first_order_lag(time, temperature, settling)) / settling

        return stack(state, [state.temperature_operator((self.id, settling), rate)])
