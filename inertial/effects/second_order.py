from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class SecondOrder(SensorEffect):
    """Output proportional to the square of the specific force: rectifies vibration."""

    id = "second_order"
    symbol = "K2"
    equation = "K2·fi²"
    coefficients = ("K2",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (5.0, 1000.0)
    hides_behind = ("scale_asymmetry", "fourth_order", "cross_axis_quadratic")
    breaker = "poses on edges or in general directions (on faces fi² and |fi| are one column)"
    simplicity = 10
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.along(axis) ** 2])
