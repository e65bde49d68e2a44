from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ThirdOrder(SensorEffect):
    """Cubic nonlinearity of the transfer curve."""

    id = "third_order"
    symbol = "K3"
    equation = "K3·fi³"
    coefficients = ("K3",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (10.0, 1000.0)
    hides_behind = ("scale", "odd_quadratic", "fifth_order")
    breaker = "poses with |fi| near 0.24, 0.5 and 0.75 g, or a centrifuge"
    simplicity = 11
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.along(axis) ** 3])
