from inertial import operators
from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State


class ThermalRate(SensorEffect):
    """Bias in proportion to the rate of temperature: a gradient across the sensor, which settles within a minute."""

    id = "thermal_rate"
    symbol = "kR"
    equation = "kR·dT/dt, over a settling time τ"
    coefficients = ("kR",)
    source = "mechanism: gradient under a steady flow of heat"
    typical_ug = (10.0, 5000.0)
    per = ("(K/min)",)
    hides_behind = ("thermal_lag",)
    breaker = "ramps at two rates; soaked readings never see it"
    same_on_axes = True
    simplicity = 20
    nonlinear = (Nonlinear("settling", "s", 4.0, 60.0, "log", 4),)

    def columns(self, state: State, axis: int, *, settling: float, **nonlinear: float) -> Array:

        def rate(time: Array, temperature: Array) -> Array:
            return 60.0 * (temperature - operators.first_order_lag(time, temperature, settling)) / settling

        return stack(state, [state.temperature_operator((self.id, settling), rate)])
