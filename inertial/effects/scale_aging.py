from inertial.effects.base import Array, SensorEffect, stack
from inertial.state import State


class ScaleAging(SensorEffect):
    """Scale factor that drifts at a constant rate."""

    id = "scale_aging"
    symbol = "K1t"
    equation = "K1t·t·(fi + δj·fj + δk·fk)"
    coefficients = ("K1t",)
    source = "mechanism: ageing of the reference or the magnet"
    typical_ug = (1.0, 1000.0)
    per = ("g·h",)
    hides_behind = ("scale_temperature",)
    breaker = "opposed poses at the beginning and at the end"
    simplicity = 28
    sharp = True

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        return stack(state, [state.time / 3600.0 * state.along(axis)])
