from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class FifthOrder(SensorEffect):
    """Fifth power of the specific force."""

    id = "fifth_order"
    symbol = "K5"
    equation = "K5·fi⁵"
    coefficients = ("K5",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (5.0, 500.0)
    hides_behind = ("third_order", "odd_quadratic")
    breaker = "poses with |fi| near 0.5 and 0.75 g, or a centrifuge"
    simplicity = 17
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.along(axis) ** 5])
