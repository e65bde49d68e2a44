from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class FourthOrder(SensorEffect):
    """Fourth power of the specific force."""

    id = "fourth_order"
    symbol = "K4"
    equation = "K4·fi⁴"
    coefficients = ("K4",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (5.0, 500.0)
    hides_behind = ("second_order", "scale_asymmetry")
    breaker = "poses with |fi| between 0.2 and 0.8 g, or a centrifuge"
    simplicity = 16
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.along(axis) ** 4])
