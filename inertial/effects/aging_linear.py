from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class AgingLinear(SensorEffect):
    """Bias that drifts at a constant rate."""

    id = "aging_linear"
    symbol = "kt"
    equation = "kt·t"
    coefficients = ("kt",)
    source = "mechanism: relaxation of stress; drift term of IEEE Std 1293-1998"
    typical_ug = (1.0, 1000.0)
    per = ("h",)
    hides_behind = ("bias_temperature", "thermal_hysteresis", "warm_up")
    breaker = "a reference pose measured again and again; soaks in mixed order"
    same_on_axes = True
    simplicity = 27

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.time / 3600.0])
