from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class Scale(SensorEffect):
    """Output per unit of specific force along the sensor's own axis."""

    id = "scale"
    symbol = "K1"
    equation = "K1·fi"
    coefficients = ("K1",)
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (1000.0, 10000.0)
    hides_behind = ("gravity_value",)
    breaker = "a surveyed value of local gravity"
    simplicity = 1

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        f = state.force[..., axis]
        return stack(state, [f])
