from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class SecondOrderTemperature(SensorEffect):
    """Quadratic term that follows temperature."""

    id = "second_order_temperature"
    symbol = "K2T"
    equation = "θ·K2T·fi²"
    coefficients = ("K2T",)
    source = "mechanism: stiffness of the suspension over temperature"
    typical_ug = (1.0, 500.0)
    hides_behind = ()
    breaker = "nine poses or more at three temperatures or more"
    simplicity = 19
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        return stack(state, [theta * state.along(axis) ** 2])
